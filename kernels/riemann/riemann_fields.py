"""The particle fields of the Riemann scheme, beside those that every scheme of fluid flow has."""

from warpsph.kernels.core.fields import COMMON, FLOW, Field, always, bodies, walls
from warpsph.kernels.core.spec import Spec


def _interface(spec: Spec) -> bool:
    return spec.interface


def _band_list(spec: Spec) -> bool:
    return spec.interface and spec.row_list


def _curved(spec: Spec) -> bool:
    return spec.curved


def _evened(spec: Spec) -> bool:
    return spec.curved and spec.tension != "body_force"


def _triple(spec: Spec) -> bool:
    return spec.triple


def _leaning(spec: Spec) -> bool:
    return spec.leaning and not spec.triple


def _bodies_corrected(spec: Spec) -> bool:
    return bodies(spec) and spec.corrected


def _pressed(spec: Spec) -> bool:
    return walls(spec) and not spec.corrected


def _staged(spec: Spec) -> bool:
    return spec.viscous_stages > 1


def _relaxing(spec: Spec) -> bool:
    return spec.relaxation


def _disorder(spec: Spec) -> bool:
    return spec.disorder


def _sided(spec: Spec) -> bool:
    return spec.multiphase and not spec.paper_star


def _viscous_jump(spec: Spec) -> bool:
    return spec.viscous_jump


def _inertia(spec: Spec) -> bool:
    return spec.inertia


def _surface_room(spec: Spec) -> bool:
    return spec.surface_room


RIEMANN_FIELDS: tuple[Field, ...] = (
    *COMMON,
    *FLOW,
    Field("midway", "vec", "fluid", False, always, "m", "position in the middle of the step, for the continuity sweep"),
    Field("state_old", "pair", "fluid", False, always, "Pa, m^d", "state before the continuity sweep"),
    Field("settled", "real", "fluid", True, _relaxing, "Pa", "pressure of the density, late by the time of relaxation"),
    Field("inertia", "vec", "fluid", True, _inertia, "m/s^2", "pressure gradient over density less gravity, followed"),
    Field("wall_impact", "real", "fluid", True, walls, "Pa", "what a wall adds to the pressure of an impact"),
    Field("wall_plane", "vec", "fluid", True, _pressed, "-", "normal of a plane of walls; of cells the axes along it"),
    Field("pressure_gradient", "vec", "fluid", True, _bodies_corrected, "Pa/m", "of the own phase"),
    Field("rate_odd", "vec", "fluid", False, _staged, "m/s^2", "y of the odd stages of friction"),
    Field("rate_even", "vec", "fluid", False, _staged, "m/s^2", "y of the even ones"),
    Field("velocity_gradient", "mat", "fluid", False, _sided, "1/s", "grad v of the own phase, next to an interface"),
    Field("gradient_at_interface", "mat", "fluid", False, _viscous_jump, "1/s", "grad v there, from the more viscous side"),
    Field("facing", "vec", "fluid", False, _sided, "-", "unit vector to the other phases, next to an interface"),
    Field("interface_depth", "real", "fluid", False, _sided, "1", "depth below an interface over h, next to it"),
    Field("flow_gradient", "mat", "fluid", True, _disorder, "1/s", "grad v of the own phase, of the last momentum sweep"),
    Field("disorder_speed", "real", "fluid", True, _disorder, "m/s", "b of the friction of disorder, -1 without a gradient"),
    Field("disorder_force", "vec", "fluid", True, _disorder, "m/s^2", "friction of disorder, held for some steps"),
    Field("wholeness", "real", "fluid", False, _surface_room, "-", "least eigenvalue of the moment of the neighbourhood"),
    Field("room_part", "real", "fluid", True, _surface_room, "1/s", "rate at which the density follows the room"),
    Field("thin", "int8", "fluid", True, _surface_room, "-", "1 in fluid thinner than the kernel reaches, away from walls"),
    Field("fraction", "real", "fluid", False, _interface, "-", "share of the own phase around a particle"),
    Field("contact_cosine", "real", "fluid", False, _leaning, "-", "of the contact angle of its own phase"),
    Field("normal", "vec", "fluid", True, _interface, "1/m", "gradient of the own phase's share"),
    Field("interface_weight", "curved", "fluid", True, _interface, "-", "(|normal| h)^2, zero away from interfaces"),
    Field("curvature", "curved", "fluid", True, _curved, "1/m", "of the interface, positive if the own phase is convex"),
    Field("mean_curvature", "curved", "fluid", False, _evened, "1/m", "the same on both sides of an interface"),
    Field("share", "phased", "fluid", False, _triple, "-", "shares of the phases around a particle"),
    Field("phase_normal", "normals", "fluid", False, _triple, "1/m", "gradients of these shares"),
    Field("band_mark", "int32", "fluid", False, _band_list, "-", "1 in the interface band"),
    Field("band_sum", "int32", "fluid", False, _band_list, "-", "running sum of band_mark"),
    Field("band", "int32", "fluid", False, _band_list, "-", "particles of the interface band, in order"),
)
