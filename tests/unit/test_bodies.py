"""Bodies in a scene: the room that they leave, fluid in rows along them, keys and files that are wrong."""

import copy
import math

import numpy as np
import pytest

from warpsph.case.case import Case, case_schema
from warpsph.case.case_file import load_case, save_case
from warpsph.errors import CaseError
from warpsph.running.model import Model
from warpsph.scene.airfoils import naca_4
from warpsph.scene.body_surfaces import surface_of
from warpsph.scene.geometry import FLUID, WALL, build

DX = 1 / 32
BASE = {
    "dimension": 2,
    "particle_spacing": DX,
    "end_time": 1.0,
    "domain": {"lower": [-0.5, -0.5], "upper": [0.5, 0.5], "boundary": {"x": "periodic", "y": "periodic"}},
    "phases": {"water": {"density": 1000, "viscosity": 1}},
    "fluids": [{"phase": "water", "shape": "rest"}],
}
CIRCLE = {"sphere": {"center": [0.01, 0.02], "radius": 0.25}}
SQUARE = {"box": {"lower": [-0.25, -0.25], "upper": [0.25, 0.25]}}
WING = {"airfoil": {"naca": "0030", "chord": 0.6, "angle": 8, "position": [-0.1, 0.0]}}


def make(shape, source_folder=None, **changes):
    """BASE with one body of a shape; `hollow` goes to the body."""
    body = {"shape": shape} | ({"hollow": True} if changes.pop("hollow", False) else {})
    return Case.from_dict(copy.deepcopy(BASE) | {"bodies": {"thing": body}} | changes, source_folder)


def problems_of(shape, **changes):
    with pytest.raises(CaseError) as caught:
        build(make(shape, **changes), 3 * DX)
    return [(problem.path, problem.rule) for problem in caught.value.problems]


def room(case):
    """Area of the domain outside the body."""
    surface = surface_of(case, case.bodies["thing"], np.array(case.domain.lower), np.array(case.domain.upper))
    return surface.measure if surface.hollow else 1.0 - surface.measure


@pytest.mark.parametrize("shape", [CIRCLE, WING])
@pytest.mark.parametrize("arrangement", ["lattice", "fitted"])
def test_the_fluid_has_the_room_that_a_body_leaves(shape, arrangement):
    case = make(shape, start={"arrangement": arrangement})
    geometry = Model(case).geometry if arrangement == "fitted" else build(case, 3 * DX)
    fluid = geometry.kind == FLUID
    assert geometry.volume[fluid].sum() == pytest.approx(room(case), abs=1e-4)
    assert geometry.volume[fluid].mean() == pytest.approx(DX**2, rel=0.005 if arrangement == "fitted" else 0.05)


def test_a_hollow_body_holds_the_fluid():
    sides = {"x": "open", "y": "open"}
    case = make(CIRCLE, hollow=True, domain=BASE["domain"] | {"boundary": sides})
    geometry = build(case, 3 * DX)
    fluid = geometry.kind == FLUID
    assert geometry.volume[fluid].sum() == pytest.approx(math.pi / 16, abs=1e-4)
    far = np.linalg.norm(geometry.position - [0.01, 0.02], axis=1)
    assert far[fluid].max() < 0.25 < far[geometry.kind == WALL].min()
    assert not geometry.at_open_side


def test_fluid_stands_in_a_row_half_a_spacing_off_a_body():
    case = make(CIRCLE)
    geometry = Model(case).geometry
    assert geometry.arrangement == "fitted" and "thing" in geometry.arrangement_reason
    off = np.linalg.norm(geometry.position[geometry.kind == FLUID] - [0.01, 0.02], axis=1) - 0.25
    assert off.min() > 0.48 * DX
    first = off[off < 0.9 * DX]
    assert first == pytest.approx(0.5 * DX, abs=0.03 * DX)
    assert len(first) == pytest.approx(2 * math.pi * (0.25 + 0.5 * DX) / DX, abs=2)


def test_a_sum_of_weights_at_a_body_is_that_of_the_lattice():
    """Partition of unity at the first rows: with rows of fluid within 2 %, and far more even than with lattice cells."""
    found = {}
    h = 1.5 * DX
    for arrangement in ("lattice", "fitted"):
        geometry = Model(make(CIRCLE, start={"arrangement": arrangement})).geometry
        fluid = geometry.position[geometry.kind == FLUID]
        near = fluid[np.linalg.norm(fluid - [0.01, 0.02], axis=1) < 0.25 + 2 * DX]
        q = np.linalg.norm(near[:, None] - geometry.position[None], axis=2) / h
        weight = 7 / (64 * math.pi) / h**2 * np.maximum(2 - q, 0) ** 4 * (1 + 2 * q)
        found[arrangement] = (weight * geometry.volume).sum(axis=1)
    whole = 1.0058  # of the lattice, docs/theory/common.md#lattice
    assert found["fitted"] == pytest.approx(whole, abs=0.02)
    assert np.std(found["lattice"]) > 4 * np.std(found["fitted"])


def test_a_body_on_the_lattice_has_the_cells_of_it():
    """A box whose faces lie between cells: its particles, and the fluid's, are in the middles of cells."""
    body = build(make(SQUARE), 16 * DX)
    assert body.arrangement == "lattice"
    middles = -0.5 + DX * (np.arange(32) + 0.5)
    sites = np.stack(np.meshgrid(middles, middles, indexing="ij"), axis=-1).reshape(-1, 2)
    inside = (np.abs(sites) < 0.25).all(axis=1)

    def rows(points):
        return sorted(tuple(row) for row in np.round(points, 9).tolist())

    assert rows(body.position[body.kind == WALL]) == rows(sites[inside])
    assert rows(body.position[body.kind == FLUID]) == rows(sites[~inside])
    assert np.ptp(body.volume) < 1e-15


def test_a_sphere_in_three_dimensions():
    dx = 0.1
    box = {"lower": [-0.5] * 3, "upper": [0.5] * 3, "boundary": dict.fromkeys("xyz", "periodic")}
    shape = {"sphere": {"center": [0, 0, 0], "radius": 0.28}}
    geometry = Model(make(shape, dimension=3, particle_spacing=dx, domain=box)).geometry
    fluid = geometry.kind == FLUID
    assert geometry.volume[fluid].sum() == pytest.approx(1 - 4 / 3 * math.pi * 0.28**3, abs=5e-4)
    assert np.linalg.norm(geometry.position[fluid], axis=1).min() > 0.28 + 0.45 * dx


def test_two_bodies_that_overlap_share_no_place():
    other = {"sphere": {"center": [0.2, 0.0], "radius": 0.2}}
    case = Case.from_dict(copy.deepcopy(BASE) | {"bodies": {"a": {"shape": CIRCLE}, "b": {"shape": other}}})
    geometry = build(case, 3 * DX)
    second = geometry.position[geometry.body == 2]
    assert len(second) and np.linalg.norm(second - [0.01, 0.02], axis=1).min() > 0.25
    assert geometry.body_names == ("a", "b")


# what is wrong ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("shape", "path", "words"),
    [
        ({"airfoil": {"chord": 1, "position": [0, 0]}}, "bodies.thing.shape.airfoil", "exactly one of naca and file"),
        ({"airfoil": {"naca": "23012", "chord": 1, "position": [0, 0]}}, "bodies.thing.shape.airfoil.naca", "four digits"),
        ({"airfoil": {"naca": 12, "chord": 1, "position": [0, 0]}}, "bodies.thing.shape.airfoil.naca", ""),
        ({"airfoil": {"naca": "0000", "chord": 1, "position": [0, 0]}}, "bodies.thing.shape.airfoil", "no thickness"),
        ({"airfoil": {"naca": "0012", "chord": 1, "position": [0, 0, 0]}}, "bodies.thing.shape.airfoil.position", ""),
        ({"polygon": {"points": [[0, 0], [0.3, 0.3], [0.3, 0], [0, 0.4]]}}, "bodies.thing.shape.polygon", "crosses"),
        ({"where": {"condition": "x > 7"}}, "bodies.thing.shape.where", "holds no point"),
        ("rest", "bodies.thing.shape", "for fluids only"),
        ({"stl": {"file": "x.stl"}}, "bodies.thing.shape.stl", "needs dimension: 3"),
        ({"sphere": {"center": [0, 0], "radius": 0.01}}, "bodies.thing.shape", "has to be 1 or more"),
    ],
)
def test_shapes_that_are_none(shape, path, words):
    found = problems_of(shape)
    assert [p for p, rule in found if p == path and words in rule], found


def test_a_file_that_is_missing_is_told_at_once(tmp_path):
    shape = {"airfoil": {"file": "no.dat", "chord": 0.5, "position": [0, 0]}}
    with pytest.raises(CaseError, match="names no file"):
        make(shape, tmp_path)


def test_airfoils_and_meshes_are_no_shapes_of_fluids():
    with pytest.raises(CaseError, match="airfoil"):
        Case.from_dict(copy.deepcopy(BASE) | {"fluids": [{"phase": "water", "shape": WING}]})


def test_the_file_of_a_body_is_found_from_another_folder(tmp_path):
    (tmp_path / "here").mkdir()
    (tmp_path / "here" / "wing.dat").write_text("\n".join(f"{x} {y}" for x, y in naca_4("0030", points=40)))
    shape = {"airfoil": {"file": "wing.dat", "chord": 0.6, "position": [0, 0]}}
    case = make(shape, tmp_path / "here")
    save_case(case, tmp_path / "there.yaml")
    again = load_case(tmp_path / "there.yaml")
    assert build(again, 3 * DX).wall_count == build(case, 3 * DX).wall_count > 0
    assert list(case.reference_files) == ["wing.dat"]


def test_a_thin_body_is_warned_of():
    geometry = build(make({"sphere": {"center": [0, 0], "radius": 1.5 * DX}}), 3 * DX)
    assert any("3 spacings" in line for line in geometry.warnings)


def test_the_schema_knows_the_shapes_of_bodies():
    text = str(case_schema())
    assert "NACA 4-digit" in text and "STL file" in text
