"""Kernels of projection ISPH."""
