"""Runs looked at: comparison, validation, pictures."""
