"""Warp kernels and the formulas they are made of, one stage per file; imported as `warpsph.kernels`.

Modules here import warp, the standard library and each other, never the rest of warpsph. None of them may use
`from __future__ import annotations`: Warp reads the annotations of a kernel as objects.
"""
