"""The gauge of the height of a free surface."""

from types import SimpleNamespace

import numpy as np
import pytest

from tests.helpers import lattice
from tests.scenes import LEAN, case_of
from warpsph import CaseError
from warpsph.measure.elevation import ElevationGauge, surface_height
from warpsph.snapshot import FLUID

SPACING = 0.05


@pytest.mark.parametrize("dimension", [2, 3])
@pytest.mark.parametrize("place", [0.0, 0.02, 0.3])
def test_height_of_a_flat_surface(dimension, place):
    """At walls and away from them, within a hundredth of a spacing."""
    counts = [20, 13] if dimension == 2 else [12, 12, 10]
    x = lattice(counts, SPACING, centre=False)
    walls = [(axis, 0.0) for axis in range(dimension)] + [(axis, counts[axis] * SPACING) for axis in range(dimension - 1)]
    volume = np.full(len(x), SPACING**dimension)
    found = surface_height(np.full(dimension - 1, place), x, volume, walls, SPACING)
    assert found == pytest.approx(counts[-1] * SPACING, abs=0.01 * SPACING)


def test_height_of_a_wave_and_of_spray():
    """A lattice stretched to a wave; a particle far above it counts for nothing, and dry places have no height."""
    dx = 1 / 60

    def height(place):
        return 1.0 + 0.05 * np.cos(np.pi * place)

    x = lattice([120, 60], dx, centre=False)
    volume = dx * dx * height(x[:, 0])
    x[:, 1] *= height(x[:, 0])
    x, volume = np.append(x, [[0.5, 1.4]], axis=0), np.append(volume, dx * dx)
    walls = [(0, 0.0), (0, 2.0), (1, 0.0)]
    for place in (0.0, 0.1, 0.5, 1.0, 2.0):
        found = surface_height(np.array([place]), x, volume, walls, dx)
        assert found == pytest.approx(height(place), abs=0.02 * dx)
    assert np.isnan(surface_height(np.array([5.0]), x, volume, walls, dx))


def test_the_gauge_in_a_case():
    case = case_of(LEAN, gauges={"surface": {"type": "elevation", "places": [[0.0], [0.5]], "interval": 0.1}})
    from warpsph.case.columns import column_names

    assert column_names("surface", case.gauges["surface"], case) == ["time", "surface_1", "surface_2"]
    with pytest.raises(CaseError, match="all axes but the last"):
        case_of(LEAN, gauges={"surface": {"type": "elevation", "places": [[0.0, 0.5]], "interval": 0.1}})


@pytest.mark.parametrize("headroom", [1, 2, 4, 8, 20])
def test_a_roof_does_not_lift_the_surface_below_it(headroom):
    """Within a hundredth of a spacing in a box whose roof is some spacings above the water."""
    found = heights_in_a_box(10, headroom)
    assert found == pytest.approx([0.5, 0.5], abs=0.01 * SPACING)


@pytest.mark.parametrize("floor", [0, 6])
def test_water_at_a_roof_has_the_height_of_the_roof(floor):
    """A full box, and water held at the roof above air."""
    found = heights_in_a_box(10, 0, floor)
    assert found == pytest.approx([0.5, 0.5], abs=0.01 * SPACING)
    assert max(found) <= 0.5


@pytest.mark.parametrize("columns, depth", [(20, 1), (12, 10)])
def test_fluid_across_a_periodic_side_counts(columns, depth):
    """At the side, beside it and in the middle."""
    length, rows = columns * SPACING, 10
    counts = [columns, rows] if depth == 1 else [columns, depth, rows]
    axes = "xyz"[: len(counts)]
    case = case_of(
        LEAN,
        dimension=len(counts),
        particle_spacing=SPACING,
        domain={
            "lower": [0] * len(counts),
            "upper": [length, *(depth * SPACING for _ in counts[2:]), 1],
            "boundary": dict.fromkeys(axes[:-1], "periodic") | {axes[-1]: "wall"},
        },
        fluids=[{"phase": "water", "shape": {"box": {"lower": [0] * len(counts), "upper": [n * SPACING for n in counts]}}}],
        start={"velocity": [0.0] * len(counts)},
        numerics={"kernel": "cubic", "smoothing_ratio": 1.2, "skin": 0.1},
        gauges={
            "surface": {
                "type": "elevation",
                "places": [[x, *(0.0 for _ in counts[2:])] for x in (0.0, 0.02, 0.5 * length, length)],
                "interval": 0.1,
            }
        },
    )
    x = lattice(counts, SPACING, centre=False)
    snapshot = SimpleNamespace(kind=np.full(len(x), FLUID), position=x, volume=np.full(len(x), SPACING ** len(counts)))
    found = ElevationGauge("surface", case.gauges["surface"], case).row(snapshot)
    assert found == pytest.approx([rows * SPACING] * 4, abs=0.01 * SPACING)


def test_a_period_narrower_than_the_kernel_reaches():
    """Eight spacings; the images next to the nearest ones count too."""
    x = lattice([4, 10], SPACING, centre=False)
    volume = np.full(len(x), SPACING**2)
    found = surface_height(np.array([0.02]), x, volume, [], SPACING, periods=[(0, 4 * SPACING)])
    assert found == pytest.approx(10 * SPACING, abs=0.01 * SPACING)


def heights_in_a_box(rows, headroom, floor=0):
    """What the gauge reads at a wall and in the middle of a closed box, of water from the row `floor` to the row `rows`."""
    roof = (rows + headroom) * SPACING
    case = case_of(
        LEAN,
        particle_spacing=SPACING,
        domain={"lower": [0, 0], "upper": [1, roof], "boundary": {"x": "wall", "y": "wall"}},
        fluids=[{"phase": "water", "shape": {"box": {"lower": [0, floor * SPACING], "upper": [1, rows * SPACING]}}}],
        gauges={"surface": {"type": "elevation", "places": [[0.0], [0.5]], "interval": 0.1}},
    )
    x = lattice([20, rows - floor], SPACING, centre=False) + [0, floor * SPACING]
    snapshot = SimpleNamespace(kind=np.full(len(x), FLUID), position=x, volume=np.full(len(x), SPACING**2))
    return ElevationGauge("surface", case.gauges["surface"], case).row(snapshot)
