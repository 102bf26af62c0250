"""Schemes: what each computes, as one object in a registry, and what it runs, to be read from top to bottom."""
