"""Case files: their models, checks and reading."""
