"""The terms of a budget of momentum and energy, in the order of its columns and of `kernels/delta/budget_sums.py`."""

KICKS = (
    "pressure",
    "tension_control",
    "viscosity",
    "artificial_viscosity",
    "wall_pressure",
    "wall_friction",
    "contact",
    "gravity",
    "body_force",
)
"""parts of the acceleration"""

CHANGES = ("exact_divergence", "density_diffusion", "shift", "volume_constraint", "room", "spray", "lift")
"""what changes density, velocity and place in steps of its own"""

TERMS = (*KICKS, *CHANGES)
OUTSIDE = ("lift",)
"""of the potential energy, and no part of the total"""

MOVING = (*KICKS, "shift")
"""terms that change the momentum"""
