"""What continuity has of a compression beside walls with a velocity of their own (theory: delta#d6)."""

LEAST_SHARE = 0.25  # in a right-angled corner whose two faces a particle touches
PARALLEL = 1.0 - 1.0e-6  # cosine from which on normals are those of one plane: rounding, or a thousand supports of radius
