"""Kernels and functions that every scheme shares."""
