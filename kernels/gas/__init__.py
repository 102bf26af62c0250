"""Kernels of the compressible gas (theory: compressible#c1 to compressible#c4)."""
