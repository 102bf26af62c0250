"""Two phases do not mix: what the shift counts particles of another phase more for."""

import numpy as np
import pytest

from warpsph.case.case import Case
from warpsph.running.model import Model

ACROSS = 24
DROP = {
    "dimension": 2,
    "particle_spacing": 1 / ACROSS,
    "end_time": 2.0,
    "domain": {"lower": [0, 0], "upper": [1, 1], "boundary": {"x": "periodic", "y": "periodic"}},
    "phases": {"drop": {"density": 1.0, "viscosity": 0.0707}, "around": {"density": 1.0, "viscosity": 0.000707}},
    "surface_tension": [{"between": ["drop", "around"], "coefficient": 1.0}],
    "fluids": [
        {"phase": "drop", "shape": {"sphere": {"center": [0.5, 0.5], "radius": 0.25}}},
        {"phase": "around", "shape": "rest"},
    ],
    "start": {"noise": 0.1, "arrangement": "lattice"},
}


def own_neighbours(snapshot):
    """Return how many particles of its own phase each one has within 1.5 spacings, in the unit periodic box."""
    d = snapshot.position[:, None] - snapshot.position[None]
    d -= np.round(d)
    near = np.linalg.norm(d, axis=-1) < 1.5 / ACROSS
    return (near & (snapshot.phase[:, None] == snapshot.phase[None])).sum(axis=1) - 1


@pytest.mark.parametrize("seed", [0, 1])
def test_a_coarse_drop_stays_whole(seed, device):
    """Equal densities, 6 particles a radius, hardly any friction outside: no particle leaves its phase in 1500 steps."""
    case = Case.from_dict(DROP).replace({"start.seed": seed})
    model = Model(case, device=device, threads=1)
    model.stepper.prepare(fresh=True)
    at_start = own_neighbours(model.snapshot())
    model.stepper.run(100.0, 1500)
    snapshot = model.snapshot()
    assert snapshot.step == 1500 and snapshot.time > 1.5
    assert at_start.min() >= 2
    assert (own_neighbours(snapshot) < 2).sum() == 0
    # the noise of the start has died away: what moves is far slower than the capillary speed
    assert np.sqrt((snapshot.velocity**2).sum(axis=1).mean()) < 0.1
