"""Kernels of the delta-plus scheme (theory: delta#d1 to delta#d6)."""
