"""Particle fields of the compressible gas."""

from warpsph.kernels.core.fields import COMMON, FLOW, Field, always
from warpsph.kernels.core.spec import Spec

HELD, GOING = 1, 2
"""values of the field `held`; 0: a particle that moves as every other"""

_SHARED = {"acceleration", "density_excess", "rest_volume", "state", "zone"}


def limited(spec: Spec) -> bool:
    """Runs with second-order reconstruction."""
    return spec.limited


def adaptive(spec: Spec) -> bool:
    """Runs whose smoothing lengths follow the density."""
    return not spec.constant_h


def predicted(spec: Spec) -> bool:
    """Runs that kick, drift and kick."""
    return not spec.runge_kutta


def whole(spec: Spec) -> bool:
    """Runs of Runge-Kutta, which advance the total energy."""
    return spec.runge_kutta


def held(spec: Spec) -> bool:
    """Runs whose open sides hold the state of the start."""
    return spec.held


VELOCITY = next(field for field in COMMON if field.name == "velocity")
OFFSET = next(field for field in COMMON if field.name == "offset")
TOTAL_ENERGY = Field("total_energy", "real", "fluid", True, whole, "J/kg", "internal and kinetic energy")
ADVANCED = (OFFSET, VELOCITY, TOTAL_ENERGY)
"""fields that Runge-Kutta advances"""

GAS_FIELDS: tuple[Field, ...] = (
    *COMMON,
    *(field for field in FLOW if field.name in _SHARED),
    Field("mass", "real", "fluid", True, always, "kg", "of a particle"),
    Field("density", "real", "fluid", True, always, "kg/m^3", "sum of m W over the neighbours"),
    Field("smoothing", "real", "fluid", True, always, "m", "smoothing length h = eta (m/rho)^(1/d)"),
    Field("listed_smoothing", "real", "fluid", True, always, "m", "smoothing length at the last list build"),
    Field("energy", "real", "fluid", True, always, "J/kg", "internal energy"),
    TOTAL_ENERGY,
    Field("power", "real", "fluid", True, always, "W/kg", "rate of the internal energy; of all of it (Runge-Kutta)"),
    Field("swelling", "real", "fluid", False, adaptive, "1/s", "rate at which the smoothing length grows, over itself"),
    Field("stiffening", "real", "fluid", True, always, "m^6/kg^2", "1/(Omega rho^2), in 2-D m^4/kg^2"),
    Field("stretching", "mat", "fluid", False, limited, "m^6/kg^2", "inverse moment of masses over rho^2, in 2-D m^4/kg^2"),
    Field("held", "uint8", "fluid", True, held, "-", "1 beside an open side: state of the start; 2 about to be let go"),
    Field("density_gradient", "vec", "fluid", False, limited, "kg/m^(d+1)", "of the last gradient sweep"),
    Field("pressure_gradient", "vec", "fluid", False, limited, "Pa/m", "of the last gradient sweep"),
    Field("velocity_gradient", "mat", "fluid", False, limited, "1/s", "[a, b] = d v_a/d x_b, of the last gradient sweep"),
    Field("velocity_half", "vec", "fluid", False, predicted, "m/s", "velocity in the middle of the step"),
    Field("energy_start", "real", "fluid", False, predicted, "J/kg", "internal energy at the start of the step"),
    Field("energy_rest", "real", "fluid", True, predicted, "J/kg", "what sums of the internal energy have rounded off"),
)
