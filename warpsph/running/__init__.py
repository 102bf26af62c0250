"""A case on its way through a run: the model on its device, and what it takes of memory."""
