"""The particle fields of projection ISPH, beside those that every scheme of fluid flow has."""

from warpsph.kernels.core.fields import COMMON, FLOW, Field, always, bodies, free_surface, moving_bodies

ISPH_FIELDS: tuple[Field, ...] = (
    *COMMON,
    *FLOW,
    Field("velocity_old", "vec", "fluid", True, always, "m/s", "velocity of the step before"),
    Field("velocity_star", "vec", "fluid", False, always, "m/s", "velocity without the pressure of the step"),
    Field("pressure", "real", "fluid", True, always, "Pa", "of the last solve, start of the next"),
    Field("pressure_gradient", "vec", "fluid", True, always, "Pa/m", "of the last step"),
    Field("lasting_gradient", "vec", "fluid", True, always, "Pa/m", "of the last two steps, without impacts"),
    Field("dilation", "real", "fluid", True, always, "1/s", "divergence of the velocity after the last step"),
    Field("dilation_old", "real", "fluid", True, always, "1/s", "the same, one step earlier"),
    Field("correction", "mat", "fluid", False, always, "-", "makes gradients exact for linear fields"),
    Field("crowding", "vec", "fluid", False, always, "1/m", "sum of grad W V: zero on an even arrangement"),
    Field("spread", "real", "fluid", False, always, "-", "divergence of the positions: d inside a fluid"),
    Field("company", "real", "fluid", False, always, "-", "spread without the own images behind walls"),
    Field("exposed", "uint8", "fluid", False, always, "-", "surface before fragments are counted to it"),
    Field("surface", "uint8", "fluid", False, always, "-", "0 inside, 1 at the free surface, 2 isolated", True),
    Field("surface_normal", "vec", "fluid", False, always, "-", "outward normal; of use at the surface alone", True),
    Field("velocity_gradient", "mat", "fluid", False, free_surface, "1/s", "of the end of the step"),
    Field("smoothing", "real", "fluid", False, free_surface, "-", "share of a deviation that smoothing takes out in a step"),
    Field("beside", "vec", "fluid", True, bodies, "-", "normal of the surface before a particle in the last step; 0: none"),
    Field("wall_gap", "real", "fluid", True, bodies, "m", "distance from it"),
    Field("wall_pace", "real", "fluid", True, bodies, "m/s", "its velocity along the normal"),
    Field("velocity_ahead", "vec", "all", False, bodies, "m/s", "velocity extrapolated to the end of the step"),
    Field("wall_before", "vec", "wall", True, moving_bodies, "m/s", "velocity of a wall particle at the start of the step"),
    Field("wall_before_old", "vec", "wall", True, moving_bodies, "m/s", "the same, one step earlier"),
    Field("wall_jump", "vec", "wall", False, moving_bodies, "m/s", "its velocity less what is extrapolated from both"),
    Field("unknown", "real", "fluid", False, always, "Pa", "solution of the pressure equation"),
    Field("source", "real", "fluid", False, always, "1/s^2", "its right-hand side"),
)
