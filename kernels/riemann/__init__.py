"""Kernels of the Riemann scheme."""
