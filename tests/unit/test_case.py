"""The case: what it accepts and means, what it refuses and how it says so, files in and out."""

import copy
import json
import pickle
import pkgutil
from importlib import import_module
from pathlib import Path
from typing import Annotated

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from jsonschema import Draft202012Validator
from pydantic import BaseModel, TypeAdapter

import warpsph.case
from warpsph.case.case import Case, case_schema
from warpsph.case.case_file import dump_case, dump_yaml, load_case, read_yaml, save_case
from warpsph.case.plain import set_path
from warpsph.errors import (
    CapacityError,
    CaseError,
    DivergenceError,
    Interrupted,
    OutputError,
    Problem,
    WallTimeReached,
    WarpsphError,
)
from warpsph.running.preview import describe
from warpsph.schemes import registry

FULL = """
title: Square droplet
description: everything at once
dimension: 2
particle_spacing: "2/52"
end_time: 20.0
precision: float32
domain:
  lower: [-1, -1]
  upper: [1, 1]
  boundary: {x: wall, y: {lower: {wall: no_slip, velocity: [1, 0]}, upper: free_slip}}
gravity: [0, -9.81]
body_force: [1e-4, 0]
central_force: {rate: 2, center: [0.5, 0.5]}
phases:
  gas: {density: 1.0, viscosity: 0.005, sound_speed: auto, gamma: 1.4, background_pressure: 0}
  liquid: {density: 1000, viscosity: 0.5, sound_speed: 10}
surface_tension:
  - {between: [gas, liquid], coefficient: 1.0}
fluids:
  - {phase: gas, shape: {box: {lower: [-0.5, -0.5], upper: [0.5, 0.5]}}}
  - {phase: gas, shape: {polygon: {points: [[-0.9, -0.9], [-0.8, -0.9], [-0.8, -0.8]]}}}
  - {phase: gas, shape: {where: {condition: "y > 0.8 + 0.05*sin(2*pi*x)"}}}
  - {phase: liquid, shape: rest}
bodies:
  block: {shape: {sphere: {center: [0.7, -0.7], radius: 0.1}}, wall: free_slip}
  pin: {shape: {sphere: {center: [0.7, 0.7], radius: 0.1}}, wall: no_slip}
start:
  noise: 0.1
  seed: 7
  velocity: ["-cos(2*pi*x)*sin(2*pi*y)", 0.5]
  pressure: hydrostatic
scales: {velocity: 1, length: auto, pressure: "2*5"}
numerics: {kernel: quintic, smoothing_ratio: 1.25, courant: 0.4, maximum_step: 1e-3, volume_constraint: false}
output:
  particles: {times: [1, 2.5], fields: [velocity, pressure, curvature]}
  checkpoint: {interval: 5, keep: 2}
gauges:
  energy: {type: energy, interval: 0.05}
  momentum: {type: momentum, interval: 0.05}
  jump: {type: phase_pressure, interval: 0.1}
  surface: {type: interface_length, interval: 0.5}
  size: {type: extents, interval: 0.1}
  load: {type: wall_force, interval: 0.01}
  probe: {type: points, points: [[0, 0], [0.1, 0]], fields: [pressure, velocity], interval: 0.1}
  profile: {type: line, from: [0, 0], to: [0, 1], count: 51, fields: [velocity], times: [0.01, 0.0225]}
reference:
  pressure_jump: {gauge: jump, column: gas - liquid, reduce: mean, window: [12, 20], value: 1.72,
                  allowed: 0.03, source: "somebody"}
  decay: {gauge: energy, column: kinetic, curve: {file: decay.csv, time: t_s, value: KE}, norm: final,
          relative_to: initial}
  profile: {gauge: profile, column: velocity_x,
            curves: {file: profile.csv, position: y_m, columns: {0.01: "u_t=0.01", 0.0225: b}}}
  l1: {particles: last, field: speed, exact: "exp(-8*pi**2/100*t)*sqrt(cos(x)**2 + sin(y)**2)", norm: l1}
  l2: {particles: last, field: velocity, exact: ["x*exp(-t)", 0], norm: l2}
validation:
  quick: [{name: "52"}]
  seed:
    - {name: R/20 ratio 1000, changes: {particle_spacing: 2/100, phases.gas: {density: 1}, reference.l1: null}}
  figure: {field: vorticity, times: [0, 1, 2]}
"""

SMALL = {
    "dimension": 2,
    "particle_spacing": 0.1,
    "end_time": 1.0,
    "domain": {"lower": [0, 0], "upper": [1, 1]},
    "phases": {"water": {"density": 1000}},
    "fluids": [{"phase": "water", "shape": "rest"}],
}


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "decay.csv").write_text("\ufefft_s, KE\n0,1\n", encoding="utf-8")
    (tmp_path / "profile.csv").write_text("y_m,u_t=0.01,b\n0,1,2\n", encoding="utf-8")
    (tmp_path / "full.yaml").write_text(FULL, encoding="utf-8")
    return tmp_path


@pytest.fixture
def full(folder: Path) -> Case:
    return load_case(folder / "full.yaml")


def small(**changes) -> dict:
    return copy.deepcopy(SMALL) | changes


def problems_of(data) -> dict[str, Problem]:
    with pytest.raises(CaseError) as caught:
        Case.from_dict(data)
    return {problem.path: problem for problem in caught.value.problems}


# ---- meaning ---------------------------------------------------------------------------------------------


def test_full_case_means_what_it_says(full: Case, folder: Path):
    assert full.spacing == full.particle_spacing == 2 / 52
    assert full.phase_names == ["gas", "liquid"]
    assert full.phases["gas"].sound_speed == "auto"
    assert full.phases["liquid"].gamma == 7
    assert full.periodic == (False, False)
    assert full.has_walls and full.has_surface_tension and not full.has_open_sides
    assert full.source_folder == folder
    y = full.sides[1]
    assert (y.lower.kind, y.lower.wall, y.lower.velocity) == ("wall", "no_slip", (1.0, 0.0))
    assert (y.upper.wall, y.upper.velocity) == ("free_slip", (0.0, 0.0))
    assert [fluid.shape.kind for fluid in full.fluids] == ["box", "polygon", "where", "rest"]
    inside = full.fluids[2].shape.where.condition.evaluate(x=np.zeros(2), y=np.array([0.7, 0.9]))
    assert inside.tolist() == [False, True]
    assert full.bodies["block"].wall == "free_slip" and not full.bodies["block"].hollow
    assert [v.evaluate(x=0.0, y=0.25).item() for v in full.start.velocity] == [-1.0, 0.5]
    assert full.start.pressure == "hydrostatic"
    assert full.scales.pressure == 10
    assert full.numerics.maximum_step == 1e-3
    assert full.numerics.volume_constraint is False
    assert full.output.particles.times == (1.0, 2.5)
    assert full.output.particles.interval is None
    line = full.gauges["profile"]
    assert (line.type, line.from_, line.to, line.count) == ("line", (0.0, 0.0), (0.0, 1.0), 51)
    assert full.reference["profile"].curves.columns == {0.01: "u_t=0.01", 0.0225: "b"}
    assert full.reference["pressure_jump"].window == (12.0, 20.0)
    assert full.reference_file("decay.csv").is_file()
    assert len(full.reference["l2"].exact) == 2


def test_defaults():
    case = Case.from_dict(SMALL)
    assert case.gravity == case.body_force == (0.0, 0.0)
    assert [v.constant for v in case.start.velocity] == [0.0, 0.0]
    assert case.start.pressure == "auto"
    assert [side.lower.kind for side in case.sides] == ["open", "open"]
    assert case.has_open_sides and not case.has_walls
    assert case.output.particles.interval == pytest.approx(0.05)
    assert case.output.checkpoint.interval == pytest.approx(0.1)
    assert case.gauges == {} and case.reference == {} and case.surface_tension == ()
    # Defaults that follow from other keys follow them again after a change.
    assert case.replace({"end_time": 2}).output.particles.interval == pytest.approx(0.1)
    three = small(dimension=3, domain={"lower": [0, 0, 0], "upper": [1, 1, 1], "boundary": {"z": "periodic"}})
    assert Case.from_dict(three).gravity == (0.0, 0.0, 0.0)
    assert Case.from_dict(three).periodic == (False, False, True)


def test_default_output_can_be_switched_off():
    case = Case.from_dict(small(output={"particles": "none", "checkpoint": "none"}))
    assert case.output.particles is None and case.output.checkpoint is None
    assert Case.from_dict(case.to_dict()).output.particles is None
    assert case.replace({"output.particles.interval": 0.5}).output.particles.interval == 0.5


@pytest.mark.parametrize(
    "written", [0.1, "1/10", "0.1", "0.2*0.5", " 1e-1 ", np.float32(0.1), np.float64(0.1)]
)
def test_numbers_may_be_arithmetic(written):
    assert Case.from_dict(small(particle_spacing=written)).spacing == pytest.approx(0.1)


def test_python_values_are_taken(full: Case):
    case = Case.from_dict(small(gravity=np.array([0.0, -1.0]), end_time=np.int64(3)))
    assert case.gravity == (0.0, -1.0) and case.end_time == 3.0
    assert isinstance(case.end_time, float)
    assert Case.from_dict(small(start={"seed": np.int64(3)})).start.seed == 3


def test_frozen(full: Case):
    with pytest.raises(ValueError, match="frozen"):
        full.end_time = 1.0
    with pytest.raises(ValueError, match="frozen"):
        full.phases["gas"].density = 2.0
    with pytest.raises(TypeError, match="replace"):
        full.phases["x"] = full.phases["gas"]
    with pytest.raises(TypeError, match="replace"):
        full.gauges.clear()


def test_copies(full: Case):
    for twin in (pickle.loads(pickle.dumps(full)), copy.deepcopy(full), copy.copy(full)):
        assert twin == full
        assert twin.source_folder == full.source_folder


def test_replace(full: Case):
    other = full.replace({"numerics.courant": 0.3, "phases.gas.density": 2, "fluids.1.phase": "liquid"})
    assert (other.numerics.courant, other.phases["gas"].density, other.fluids[1].phase) == (
        0.3,
        2.0,
        "liquid",
    )
    assert full.numerics.courant == 0.4
    assert other.source_folder == full.source_folder
    assert full.replace({}) == full
    with pytest.raises(CaseError) as caught:
        full.replace({"numerics.courant": -1, "phases.gas.densty": 2})
    assert {p.path for p in caught.value.problems} == {"numerics.courant", "phases.gas.densty"}
    with pytest.raises(CaseError, match="list of 4"):
        full.replace({"fluids.7.phase": "gas"})


def test_dictionary_gives_the_same_case(full: Case):
    assert Case.from_dict(full.to_dict(), full.source_folder) == full
    complete = full.to_dict(defaults=True)
    again = Case.from_dict(complete, full.source_folder)
    assert again.to_dict(defaults=True) == complete
    json.dumps(full.to_dict())


@pytest.mark.parametrize(
    ("numerics", "boundary", "expected"),
    [
        ({}, "wall", ("corrected", "weighted", "morris", 16.0, True, 0.0)),
        ({}, "open", ("conservative", "weighted", "isotropic", 0.0, False, 0.0)),
        ({"pressure_gradient": "corrected"}, "open", ("corrected", "weighted", "isotropic", 16.0, False, 0.0)),
        (
            {"pressure_gradient": "conservative"},
            "wall",
            ("conservative", "weighted", "morris", 0.0, False, 0.0),
        ),
        ({"formulation": "paper"}, "wall", ("conservative", "arithmetic", "paper", 0.0, False, 0.08)),
        (
            {"formulation": "paper", "interface_force": 0.01},
            "wall",
            ("conservative", "arithmetic", "paper", 0.0, False, 0.01),
        ),
    ],
)
def test_resolved_choices(numerics, boundary, expected):
    data = small(numerics=numerics)
    data["domain"]["boundary"] = {"x": boundary, "y": boundary}
    data["phases"]["water"]["viscosity"] = 1e-3
    resolved = describe(Case.from_dict(data))["resolved"]
    keys = (
        "pressure_gradient",
        "star_states",
        "viscosity_form",
        "shifting",
        "volume_constraint",
        "interface_force",
    )
    assert tuple(resolved["numerics"][key] for key in keys) == expected
    Case.from_dict(resolved)


def test_resolved_isph_can_be_read_back():
    resolved = describe(Case.from_dict(small(numerics={"scheme": "isph"})))["resolved"]
    again = describe(Case.from_dict(resolved))["resolved"]
    assert again["numerics"] == resolved["numerics"] and again["numerics"]["time_order"] == 2


def test_resolved_takes_what_is_known_and_absolute_files(full: Case):
    resolved = full.resolved({"phases.gas.sound_speed": 12.5, "numerics.smoothing_ratio": 1.5})
    assert resolved["phases"]["gas"]["sound_speed"] == 12.5
    assert resolved["numerics"]["smoothing_ratio"] == 1.5
    assert Path(resolved["reference"]["decay"]["curve"]["file"]).is_absolute()


# ---- refusal ---------------------------------------------------------------------------------------------


def changed(path: str, value) -> dict:
    data = read_yaml(FULL)
    set_path(data, path, value)
    return data


GOOD_BOX = {"box": {"lower": [0, 0], "upper": [0.5, 0.5]}}
IN_3D = {"dimension": 3, "domain": {"lower": [0, 0, 0], "upper": [1, 1, 1]}}


@pytest.mark.parametrize(
    ("path", "value", "where", "rule"),
    [
        ("domain.lower", [1], "domain.lower", "needs 2 numbers (dimension: 2)"),
        ("domain.upper", [-1, 1], "domain.upper", "above lower on the x axis"),
        ("domain.lower", [1, 2, 3], "domain.lower", "needs 2 numbers"),
        ("domain.lower", [], "domain.lower", "at least 1"),
        ("domain.boundary.z", "wall", "domain.boundary.z", "no z axis"),
        (
            "domain.boundary.x",
            {"lower": "periodic", "upper": "wall"},
            "domain.boundary.x.lower",
            "cannot be periodic",
        ),
        (
            "domain.boundary.x",
            {"wall": "no_slip", "velocity": [1, 0]},
            "domain.boundary.x.velocity",
            "out of its plane",
        ),
        (
            "domain.boundary.x",
            {"wall": "no_slip", "velocity": [0]},
            "domain.boundary.x.velocity",
            "needs 2 numbers",
        ),
        ("domain.boundary.x", {"velocity": [0, 1]}, "domain.boundary.x.wall", "required"),
        (
            "domain.boundary.x",
            {"lower": "open", "upper": {"wall": "noslip"}},
            "domain.boundary.x.upper.wall",
            "one of",
        ),
        ("particle_spacing", 3, "particle_spacing", "no room"),
        ("particle_spacing", 1e-9, "particle_spacing", "2^31"),
        ("particle_spacing", 0, "particle_spacing", "> 0"),
        ("particle_spacing", -0.1, "particle_spacing", "> 0"),
        ("particle_spacing", True, "particle_spacing", "not true"),
        ("particle_spacing", float("nan"), "particle_spacing", "finite"),
        ("particle_spacing", float("inf"), "particle_spacing", "finite"),
        ("particle_spacing", 10**400, "particle_spacing", "finite"),
        ("particle_spacing", "2/0", "particle_spacing", "finite"),
        ("particle_spacing", "1 mm", "particle_spacing", "not a formula"),
        ("particle_spacing", "auto", "particle_spacing", "> 0"),
        ("particle_spacing", None, "particle_spacing", "no value"),
        ("end_time", "x", "end_time", "unknown name x"),
        ("phases.gas.density", -1, "phases.gas.density", "> 0"),
        ("phases.gas.viscosity", -1, "phases.gas.viscosity", ">= 0"),
        ("phases.gas.sound_speed", 0, "phases.gas.sound_speed", "or auto"),
        ("phases.gas.gamma", 0.5, "phases.gas.gamma", ">= 1"),
        ("phases.2nd", {"density": 1}, "phases.2nd", "needs a name"),
        ("phases.spare", {"density": 1}, "phases.spare", "of no fluid"),
        ("phases", {}, "phases", "at least 1"),
        ("fluids", [], "fluids", "at least 1"),
        ("fluids.0.phase", "gaz", "fluids.0.phase", "not one of the phases"),
        ("fluids.1.shape", "rest", "fluids.1.shape", "last"),
        ("fluids.0.shape", {"box": GOOD_BOX["box"], "sphere": {}}, "fluids.0.shape", "exactly one"),
        ("fluids.0.shape", "everything", "fluids.0.shape", "exactly one"),
        (
            "fluids.0.shape",
            {"box": {"lower": [5, 5], "upper": [6, 6]}},
            "fluids.0.shape.box",
            "outside the domain",
        ),
        (
            "fluids.0.shape",
            {"box": {"lower": [0.5, 0], "upper": [0.5, 1]}},
            "fluids.0.shape.box.upper",
            "above lower",
        ),
        (
            "fluids.0.shape",
            {"sphere": {"center": [0, 0], "radius": 0}},
            "fluids.0.shape.sphere.radius",
            "> 0",
        ),
        ("fluids.0.shape", {"where": {"condition": "z < 1"}}, "fluids.0.shape.where.condition", "uses z"),
        ("fluids.0.shape", {"where": {"condition": "x + 1"}}, "fluids.0.shape.where.condition", "a number"),
        (
            "fluids.0.shape",
            {"where": {"condition": "t < 1"}},
            "fluids.0.shape.where.condition",
            "unknown name t",
        ),
        (
            "fluids.0.shape",
            {"polygon": {"points": [[0, 0], [1, 1]]}},
            "fluids.0.shape.polygon.points",
            "3 corners",
        ),
        (
            "fluids.0.shape",
            {"polygon": {"points": [[0, 0], [1, 1], [0.5, 0.5]]}},
            "fluids.0.shape.polygon.points",
            "no area",
        ),
        ("surface_tension.0.between", ["gas", "gas"], "surface_tension.0.between", "two different"),
        ("surface_tension.0.between", ["gas", "oil"], "surface_tension.0.between.1", "not one of the phases"),
        (
            "surface_tension",
            [
                {"between": ["gas", "liquid"], "coefficient": 1},
                {"between": ["liquid", "gas"], "coefficient": 1},
            ],
            "surface_tension.1.between",
            "second time",
        ),
        ("bodies.block.shape", "rest", "bodies.block.shape", "fluids only"),
        ("obstacles", [{"shape": GOOD_BOX}], "obstacles", "bodies"),
        ("start.noise", 0.31, "start.noise", "<= 0.3"),
        ("start.seed", 1.5, "start.seed", "whole number"),
        ("start.velocity", ["z", 0], "start.velocity.0", "uses z"),
        ("start.velocity", [0], "start.velocity", "needs 2 numbers"),
        ("start.velocity", ["x < 1", 0], "start.velocity.0", "true or false"),
        ("start.pressure", "hydrostatics", "start.pressure", "unknown name hydrostatics"),
        ("numerics.kernel", "wendland", "numerics.kernel", "one of"),
        ("numerics.volume_constraint", 1, "numerics.volume_constraint", "true, false or auto"),
        ("numerics.neighbour_capacity", 1.5, "numerics.neighbour_capacity", "whole number"),
        ("output.particles.fields", ["speed"], "output.particles.fields", "no field speed"),
        ("output.particles.fields", ["velocity", "velocity"], "output.particles.fields", "twice"),
        ("output.particles.interval", 1, "output.particles", "both"),
        ("output.particles.times", [2, 1], "output.particles.times", "rising"),
        ("output.checkpoint.interval", 1e-9, "output.checkpoint.interval", "outputs"),
        ("gauges.energy.type", "enrgy", "gauges.energy", "unknown type"),
        ("gauges.energy", {"interval": 1}, "gauges.energy", "key type"),
        ("gauges.energy", {"type": "energy"}, "gauges.energy", "neither"),
        ("gauges.probe.points", [[0, 0], [0]], "gauges.probe.points.1", "needs 2 numbers"),
        ("gauges.profile.to", [0, 0], "gauges.profile.to", "same point"),
        ("gauges.profile.count", 1, "gauges.profile.count", ">= 2"),
        ("gauges.profile.times", [0.01], "reference.profile.curves.columns", "not one of the times"),
        ("gauges.profile.fields", ["pressure"], "reference.profile.column", "not a column"),
        ("reference.pressure_jump.gauge", "jmup", "reference.pressure_jump.gauge", "not one of the gauges"),
        (
            "reference.pressure_jump.column",
            "gas - fluid",
            "reference.pressure_jump.column",
            "unknown name fluid",
        ),
        ("reference.pressure_jump.window", [20, 12], "reference.pressure_jump.window", "first before"),
        ("reference.pressure_jump.curve", {}, "reference.pressure_jump", "exactly one"),
        ("reference.decay.gauge", "profile", "reference.decay.gauge", "type line"),
        ("reference.profile.gauge", "energy", "reference.profile.gauge", "type line"),
        ("reference.profile.curves.columns", {"a": "b"}, "reference.profile.curves.columns", "times"),
        ("reference.pressure_jump.reduce", "slope", "reference.pressure_jump.gauge", "type line"),
        ("reference.pressure_jump.between", [0.2, 0.1], "reference.pressure_jump.between", "smaller one first"),
        ("reference.pressure_jump.gauge", "profile", "reference.pressure_jump.gauge", "profiles"),
        ("reference.decay.window", [2, 1], "reference.decay.window", "the first before the second"),
        ("reference.l1.exact", "z", "reference.l1.exact", "uses z"),
        ("reference.l1.exact", ["x", "y"], "reference.l1.exact", "needs 1 formula"),
        ("reference.l2.exact", "x", "reference.l2.exact", "needs 2 formulas"),
        ("output.particles.fields", ["pressure"], "reference.l1.field", "needs velocity"),
        ("output.particles", "none", "reference.l1.particles", "output.particles is none"),
        ("dimension", 4, "dimension", "one of 1, 2, 3"),
        ("title", 5, "title", "needs text"),
        ("kernel", "cubic", "kernel", "not a known key"),
    ],
)
def test_refused(path, value, where, rule):
    problems = problems_of(changed(path, value))
    assert where in problems, problems
    assert rule in problems[where].rule
    # A problem must not drag others along, bar those that it really causes.
    assert len(problems) <= 2 or path == "phases", problems


LINE = {"phase": "water", "interface": {"file": "line.csv", "time": 0.5}}


def line(**changes):
    """An interface to compare with, its file changed."""
    return {**LINE, "interface": {**LINE["interface"], **changes}}


@pytest.mark.parametrize("output", [{}, {"particles": {"interval": 0.1}}, {"particles": {"times": [0.25, 0.5]}}])
def test_an_interface_to_compare_with(output):
    case = Case.from_dict(small(reference={"a": line(time="1/2", mirror="none")}, output=output))
    spec = case.reference["a"]
    assert (spec.interface.scale, spec.interface.offset, spec.interface.mirror) == (1.0, (0.0, 0.0), None)
    assert Case.from_dict(case.to_dict()) == case
    # the end of the run is written too
    Case.from_dict(small(reference={"a": line(time=1.0)}, output={"particles": {"interval": 0.3}}))


@pytest.mark.parametrize(
    ("changes", "where", "rule"),
    [
        ({"gauges": {"f": {"type": "wall_force", "interval": 1}}}, "gauges.f.type", "needs a wall"),
        ({"gauges": {"f": {"type": "interface_length", "interval": 1}}}, "gauges.f.type", "two phases"),
        (
            {"output": {"particles": {"interval": 1, "fields": ["normal"]}}},
            "output.particles.fields",
            "surface_tension",
        ),
        ({"numerics": {"volume_constraint": True}}, "numerics.volume_constraint", "closed or periodic"),
        (IN_3D | {"gravity": [0, 0]}, "gravity", "needs 3 numbers"),
        (
            IN_3D
            | {"fluids": [{"phase": "water", "shape": {"polygon": {"points": [[0, 0], [1, 0], [0, 1]]}}}]},
            "fluids.0.shape.polygon",
            "dimension: 2",
        ),
        (IN_3D | {"gauges": {"f": {"type": "contour", "interval": 1}}}, "gauges.f.type", "dimension: 2"),
        ({"gauges": {"f": {"type": "contour", "interval": 1, "mirror": "z"}}}, "gauges.f.mirror", "one of x, y, none"),
        (IN_3D | {"reference": {"a": LINE}}, "reference.a", "dimension: 2"),
        ({"reference": {"a": LINE | {"phase": "oil"}}}, "reference.a.phase", "one of the phases"),
        ({"reference": {"a": LINE | {"relative_to": "peak"}}}, "reference.a.relative_to", "domain, phase"),
        ({"reference": {"a": line(offset=[0])}}, "reference.a.interface.offset", "2 numbers"),
        ({"reference": {"a": LINE}, "output": {"particles": "none"}}, "reference.a.interface.time", "particle files"),
        ({"reference": {"a": LINE}, "output": {"particles": {"interval": 0.3}}}, "reference.a.interface.time", "not a time"),
        ({"reference": {"a": LINE}, "output": {"particles": {"times": [0.3]}}}, "reference.a.interface.time", "not a time"),
        (
            {"reference": {"a": LINE}, "output": {"particles": {"interval": 0.5, "fields": ["mass"]}}},
            "reference.a.interface",
            "phase, density",
        ),
    ],
)
def test_refused_small(changes, where, rule):
    assert rule in problems_of(small(**changes))[where].rule


@pytest.mark.parametrize(
    ("length", "numerics", "fits"),
    [
        (0.6, {}, True),
        (0.59, {}, False),
        (0.6, {"smoothing_ratio": 1.6}, False),
        (0.4, {"smoothing_ratio": 1.0}, True),
        (0.6, {"smoothing_ratio": 1.0, "kernel": "quintic"}, True),
        (0.59, {"smoothing_ratio": 1.0, "kernel": "quintic"}, False),
    ],
)
def test_periodic_box_holds_two_supports(length, numerics, fits):
    data = small(numerics=numerics)
    data["domain"] = {"lower": [0, 0], "upper": [length, 1], "boundary": {"x": "periodic"}}
    if fits:
        assert Case.from_dict(data).periodic == (True, False)
    else:
        assert "twice the support" in problems_of(data)["domain.boundary.x"].rule


def test_hydrostatic_needs_a_floor():
    data = small(gravity=[0, -1], start={"pressure": "hydrostatic"})
    data["domain"]["boundary"] = {"x": "periodic", "y": "wall"}
    assert Case.from_dict(data).start.pressure == "hydrostatic"
    data["domain"]["boundary"] = {"y": "periodic"}
    assert "periodic" in problems_of(data)["start.pressure"].rule


def test_all_problems_at_once():
    data = read_yaml(FULL)
    data["domain"]["lower"] = [1]
    data["phases"]["gas"]["densty"] = data["phases"]["gas"].pop("density")
    data["phases"]["liquid"]["viscosity"] = -1
    data["kernel"] = "cubic"
    data["numerics"] = {"kernel": "wendland2"}
    data["fluids"].insert(0, {"phase": "gass", "shape": "rest"})
    data["gauges"]["energy"]["intervall"] = data["gauges"]["energy"].pop("interval")
    data["gauges"]["probe"]["points"].append([1])
    data["gauges"]["probe"]["count"] = 1
    data["start"]["velocity"] = ["np.sin(x)", "z"]
    data["reference"]["l1"]["exact"] = "z"
    data["bodies"]["block"]["shape"] = {"spher": {}}
    data["output"]["particles"]["fields"] = "velocity"
    del data["end_time"]
    data[5] = 6
    assert set(problems_of(data)) == {
        "domain.lower",
        "phases.gas.densty",
        "phases.liquid.viscosity",
        "kernel",
        "numerics.kernel",
        "fluids.0.phase",
        "fluids.0.shape",
        "gauges.energy.intervall",
        "gauges.probe.points.2",
        "gauges.probe.count",
        "start.velocity.0",
        "reference.l1.exact",
        "bodies.block.shape.spher",
        "output.particles.fields",
        "end_time",
        "5",
    }


def test_wording():
    problems = problems_of(
        small(domain={"lower": [1], "upper": [1, 1]}, numerics={"curant": 1}, courant=1, phases={"water": {}})
    )
    assert str(problems["domain.lower"]) == (
        "domain.lower: [1] -> needs 2 numbers (dimension: 2); write e.g. lower: [0, 0]"
    )
    assert problems["numerics.curant"].remedy == "did you mean courant?"
    assert "numerics.courant" in problems["courant"].remedy
    assert str(problems["phases.water.density"]) == (
        "phases.water.density: (missing) -> is required (reference density, kg/m^3); add e.g. density: 1000"
    )
    text = str(CaseError([Problem("a\nb", "x\ny" * 100, "r\r", "m")] * 70))
    assert len(text.split("\n")) == 51
    assert text.endswith("and 20 more")
    assert max(map(len, text.split("\n"))) < 100
    assert len(str(Problem("a", ["x" * 30] * 1000, "rule"))) < 100
    assert len(str(Problem("a", 10**5000, "rule"))) < 100
    assert len(str(Problem("a", set(range(1000)), "rule"))) < 100


@pytest.mark.parametrize("data", [None, 5, "x", [], [1], {}, {None: 1}, {1: {2: 3}}])
def test_anything_else_is_refused(data):
    assert problems_of(data)


def test_direct_construction_is_checked_too():
    with pytest.raises(CaseError):
        Case(dimension=4)  # type: ignore[call-arg]
    assert Case(**SMALL) == Case.from_dict(SMALL)


# ---- messages stay short ---------------------------------------------------------------------------------


def places(data, path=()):
    """Every mapping and list of nested data with each of its keys."""
    for key, item in data.items() if isinstance(data, dict) else enumerate(data):
        yield (*path, key)
        if isinstance(item, dict | list):
            yield from places(item, (*path, key))


LONG = "so_long_" * 5000
# What a validation run changes is read with that run.
EVERYWHERE = [path for path in places(read_yaml(FULL)) if "changes" not in path]


@pytest.mark.parametrize(
    ("value", "first"), [(LONG, 0), ([LONG] * 1000, 1), ({LONG: LONG}, 2)], ids=["text", "list", "mapping"]
)
def test_long_input_is_not_echoed_whole(folder: Path, value, first):
    """40 kB in place of a value, or as a key beside it, make a message that fits on a screen."""
    for path in EVERYWHERE[first::3]:
        data = read_yaml(FULL)
        holder = data
        for key in path[:-1]:
            holder = holder[key]
        holder[path[-1]] = value
        if isinstance(holder, dict):
            holder[LONG] = value
        with pytest.raises(CaseError) as caught:
            Case.from_dict(data, folder)
        assert all(len(line) < 1500 for line in str(caught.value).splitlines()), path
    with pytest.raises(CaseError) as caught:
        Case.from_dict(read_yaml(FULL)).replace({f"end_time.{LONG}": 1, LONG: 2})
    assert all(len(line) < 1500 for line in str(caught.value).splitlines())


def test_an_unknown_gauge_type_is_told_in_short():
    (problem,) = problems_of(small(gauges={"a": {"type": "contur" + 40_000 * "r", "interval": 1}})).values()
    assert len(str(problem)) < 400 and "has an unknown type contur" in problem.rule
    (problem,) = problems_of(small(gauges={"a": {"type": "contur", "interval": 1}})).values()
    assert problem.remedy == "did you mean contour?"


# ---- columns of gauges -----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("gauge", "column", "remedy"),
    [
        ("energy", "kinetc", "did you mean kinetic?"),
        ("energy", "kinetic_gas", "did you mean kinetic gas?"),
        ("energy", "kinetic + potentail", "did you mean potential?"),
        ("momentum", "momentum_z", "did you mean momentum_"),
        ("jump", "gass", "did you mean gas?"),
        ("jump", "gas - solid", "liquid"),
        ("surface", "length", "interface_length"),
        ("size", "semi_axis_z gas", "did you mean semi_axis_"),
        ("load", "force_x domian", "did you mean force_x domain?"),
        ("probe", "density", "pressure"),
        ("profile", "speed", "velocity_x"),
        ("profile", "velocity_z", "did you mean velocity_"),
    ],
)
def test_columns_are_known_before_the_run(folder: Path, gauge, column, remedy):
    data = read_yaml(FULL)
    entry = {"gauge": gauge, "column": column, "value": 1, "reduce": "slope" if gauge == "profile" else "mean"}
    data["reference"] = {"wrong": entry}
    with pytest.raises(CaseError) as caught:
        Case.from_dict(data, folder)
    (problem,) = caught.value.problems
    assert problem.path == "reference.wrong.column" and f"is not a column of gauge {gauge}" in problem.rule
    assert remedy in problem.remedy
    # and beside another fault
    data["end_time"] = -1
    with pytest.raises(CaseError) as caught:
        Case.from_dict(data, folder)
    assert {problem.path for problem in caught.value.problems} == {"end_time", "reference.wrong.column"}


@pytest.mark.parametrize(
    ("gauge", "column"),
    [
        ("energy", "2 * kinetic gas + elastic"),
        ("energy", "total liquid"),
        ("jump", "gas - liquid"),
        ("jump", "gas-liquid"),
        ("size", "highest_x gas - lowest_x gas"),
        ("load", "force_y domain"),
        ("probe", "velocity_y/2"),
    ],
)
def test_columns_and_arithmetic_of_columns_are_fine(folder: Path, gauge, column):
    data = read_yaml(FULL)
    data["reference"] = {"right": {"gauge": gauge, "column": column, "value": 1}}
    Case.from_dict(data, folder)


# ---- schema ----------------------------------------------------------------------------------------------


def models() -> list[type[BaseModel]]:
    """The models of all sections and schemes."""
    names = [f"warpsph.case.{info.name}" for info in pkgutil.iter_modules(warpsph.case.__path__)]
    names += [registry.find(name).numerics.__module__ for name in registry.names()]
    return [
        item
        for module in map(import_module, names)
        for item in vars(module).values()
        if isinstance(item, type) and issubclass(item, BaseModel) and item.__module__ == module.__name__
    ]


def test_models_are_found():
    found = {model.__name__ for model in models()}
    assert {"Case", "Side", "Start", "Shape", "LineGauge", "ReferenceValue", "IsphNumerics"} <= found


@pytest.mark.parametrize("model", models(), ids=lambda model: model.__name__)
def test_every_field_is_described_and_its_example_is_valid(model):
    for name, info in model.model_fields.items():
        assert info.description, name
        for example in info.examples or ():
            value = read_yaml(f"x: {example}")["x"]
            annotation = info.annotation
            if info.metadata:
                annotation = Annotated[(annotation, *info.metadata)]
            TypeAdapter(annotation).validate_python(value)


def test_schema():
    schema = case_schema()
    json.dumps(schema)
    assert set(schema["properties"]) == set(read_yaml(FULL))
    assert schema["additionalProperties"] is False
    assert {"dimension", "particle_spacing", "end_time", "domain", "phases", "fluids"} == set(
        schema["required"]
    )
    assert "from" in schema["$defs"]["LineGauge"]["properties"]
    assert "<" not in "".join(schema["$defs"]["AxisBoundary"])


def is_allowed_by_schema(data) -> bool:
    return Draft202012Validator(case_schema()).is_valid(json.loads(json.dumps(data)))


ROOT = Path(__file__).parents[2]
SHIPPED = [*sorted((ROOT / "cases").glob("*.yaml")), ROOT / "warpsph" / "starter.yaml"]


@pytest.mark.parametrize("path", SHIPPED, ids=lambda path: path.stem)
def test_schema_allows_every_case_file(path: Path):
    """As it stands, and as a run folder and `show` write it, where more keys are `none`."""
    assert is_allowed_by_schema(read_yaml(path.read_text(encoding="utf-8")))
    case = load_case(path)
    assert is_allowed_by_schema(case.to_dict(defaults=True))
    assert is_allowed_by_schema(case.resolved({}))


@pytest.mark.parametrize(
    ("path", "value"),
    [
        ("end_time", "2/52"),
        ("end_time", "3*sqrt(1/9.81)"),
        ("numerics", {"maximum_step": "none", "skin": "auto", "courant": "1/2", "volume_constraint": False}),
        ("numerics", {"maximum_step": None, "neighbour_capacity": "4*16"}),
        ("output", {"particles": "none", "checkpoint": "none"}),
        ("start", {"pressure": "none", "velocity": [0, "sin(2*pi*x)"]}),
        ("start", {"pressure": "hydrostatic"}),
        ("start", {"pressure": "where(y < 0.5 and not x > 1e-3, 9.81*(1 - y), 0)"}),
        ("domain", {"lower": [0, 0], "upper": ["2*pi", 1], "boundary": {"x": {"wall": "no_slip", "velocity": [0, "1/2"]}}}),
        ("gauges", {"line": {"type": "contour", "mirror": "none", "times": ["1/3", 0.5]}}),
        ("reference", {"speed": {"particles": "last", "field": "speed", "exact": "exp(-t)*r"}}),
        ("reference", {"speed": {"particles": "last", "field": "speed", "exact": 0}}),
        ("reference", {"speed": {"particles": "last", "field": "velocity", "exact": [0, "x"]}}),
    ],
)
def test_schema_allows_what_a_case_may_write(path, value):
    data = small(**{path: value})
    Case.from_dict(data)
    assert is_allowed_by_schema(data)


@pytest.mark.parametrize(
    ("path", "value"),
    [
        ("end_tme", 1),
        ("end_time", True),
        ("end_time", [1]),
        ("end_time", "soon"),
        ("end_time", "auto"),
        ("end_time", "none"),
        ("end_time", 0),
        ("dimension", 4),
        ("dimension", "two"),
        ("domain", {"lower": [0, 0], "upper": [1, "top"]}),
        ("domain", {"lower": [0, 0], "upper": [1, 1], "boundary": {"x": "wal"}}),
        ("domain", {"lower": [0, 0], "upper": [1, 1], "boundary": {"x": {"wall": "no_slip", "velocity": ["fast", 0]}}}),
        ("phases", {"water": {"density": "heavy"}}),
        ("phases", {"water": {"density": 1, "viscosty": 1}}),
        ("fluids", [{"phase": "water", "shape": "the rest"}]),
        ("fluids", [{"phase": "water", "shape": {"where": {"condition": 1}}}]),
        ("start", {"pressure": "hydrostatc"}),
        ("start", {"velocity": ["sin(2*pi*q)", 0]}),
        ("numerics", {"maximum_step": "never"}),
        ("numerics", {"kernel": "wendland"}),
        ("output", {"particles": "never"}),
        ("output", {"checkpoint": {"interval": "none"}}),
        ("gauges", {"line": {"type": "contour", "mirror": "z", "interval": 1}}),
        ("gauges", {"line": {"type": "contours", "interval": 1}}),
        ("reference", {"speed": {"particles": "last", "field": "speed", "exact": {"x": 1}}}),
    ],
)
def test_schema_refuses_unknown_keys_and_wrong_types(path, value):
    data = small(**{path: value})
    problems_of(data)
    assert not is_allowed_by_schema(data)


# ---- files -----------------------------------------------------------------------------------------------


def test_overrides(folder: Path):
    case = load_case(
        folder / "full.yaml",
        [
            "end_time=2*3",
            "domain.boundary.x=periodic",
            "numerics.skin=0.1",
            "fluids.0.phase=liquid",
            "title=a = b",
            "start.velocity=[0, x]",
            "gauges.extra={type: energy, interval: 1}",
        ],
    )
    assert (case.end_time, case.periodic, case.numerics.skin) == (6.0, (True, False), 0.1)
    assert (case.fluids[0].phase, case.title) == ("liquid", "a = b")
    assert case.start.velocity[1].evaluate(x=3.0) == 3
    assert list(case.gauges)[-1] == "extra"


def test_validation_runs_keep_their_changes(full: Case):
    assert [run.name for run in full.validation.quick] == ["52"]
    run = full.validation.seed[0]
    assert run.changes["particle_spacing"] == "2/100" and run.changes["phases.gas"] == {"density": 1}
    assert full.validation.fine == () and full.validation.figure.times == (0.0, 1.0, 2.0)
    again = Case.from_dict(full.to_dict(), full.source_folder)
    assert again == full and again.validation.seed[0].changes == run.changes
    assert "validation" not in full.resolved({})


def test_a_case_without_a_validation_section_has_one_quick_run():
    case = Case.from_dict(small())
    assert [(run.name, dict(run.changes)) for run in case.validation.quick] == [("default", {})]
    assert case.validation.seed == case.validation.fine == () and case.validation.figure is None


@pytest.mark.parametrize(
    "section, path, words",
    [
        ({"quick": [{"name": 52}]}, "validation.quick.0.name", 'write name: "52"'),
        ({"quick": [{"name": "a/../b|"}]}, "validation.quick.0.name", "letters, digits"),
        ({"quick": [{"name": "1 a"}, {"name": "1_A"}]}, "validation.quick", "two runs with the name 1_A"),
        ({"seed": [{"name": "a", "changes": {"spacing": 1}}]}, "validation.seed.0.changes", "spacing does not begin"),
        ({"fine": [{"name": "a", "changes": {"validation.quick": []}}]}, "validation.fine.0.changes", "does not begin"),
        ({"fine": [{"name": "a", "changes": {"phases..x": 1}}]}, "validation.fine.0.changes", "dotted paths"),
        ({"quik": []}, "validation.quik", "did you mean quick"),
        ({"figure": {"field": "colour"}}, "validation.figure.field", "phase, speed, pressure, density, vorticity"),
        ({"figure": {"field": "phase", "times": [1, 0]}}, "validation.figure.times", "rising"),
        ({"figure": {"field": "phase", "phases": ["watr"]}}, "validation.figure.phases.0", "is not one of the phases"),
        ({"figure": {"field": "phase", "phases": []}}, "validation.figure.phases", "at least 1 entry"),
    ],
)
def test_bad_validation_sections(section, path, words):
    problems = problems_of(small(validation=section))
    assert words in str(problems[path])


def test_entries_of_reference_and_gauges_can_be_taken_out(full: Case, folder: Path):
    assert list(full.replace({"reference.decay": None}).reference) == ["pressure_jump", "profile", "l1", "l2"]
    without = load_case(folder / "full.yaml", ["reference.pressure_jump=none", "gauges.jump=null"])
    assert "jump" not in without.gauges and "pressure_jump" not in without.reference
    with pytest.raises(CaseError, match="reference.decai.*no such entry.*did you mean decay"):
        full.replace({"reference.decai": None})
    with pytest.raises(CaseError, match="reference.decay.gauge: energy -> is not one of the gauges"):
        full.replace({"gauges.energy": None})


def test_problems_have_line_and_column(folder: Path):
    path = folder / "full.yaml"
    path.write_text(
        FULL.replace("lower: [-1, -1]", "lower: [-1]").replace("seed: 7", "sed: 7"), encoding="utf-8"
    )
    with pytest.raises(CaseError) as caught:
        load_case(path, ["gravity=[1]"])
    places = {p.path: (p.line, p.column) for p in caught.value.problems}
    lines = path.read_text(encoding="utf-8").split("\n")
    assert lines[places["domain.lower"][0] - 1] == "  lower: [-1]"
    assert lines[places["start.sed"][0] - 1] == "  sed: 7"
    assert places["start.sed"][1] == 3
    # What the command line said has no line in the file.
    assert places["gravity"] == (None, None)


def test_missing_reference_files_and_columns(folder: Path):
    (folder / "decay.csv").unlink()
    (folder / "profile.csv").write_text("y_m,u_t=0.1,b\n", encoding="utf-8")
    with pytest.raises(CaseError) as caught:
        load_case(folder / "full.yaml")
    problems = {p.path: p for p in caught.value.problems}
    assert set(problems) == {"reference.decay.curve.file", "reference.profile.curves.columns.0.01"}
    assert "u_t=0.1" in problems["reference.profile.curves.columns.0.01"].remedy


def test_saved_case_is_the_same_case(full: Case, folder: Path, tmp_path_factory):
    save_case(full, folder / "copy.yaml")
    assert load_case(folder / "copy.yaml") == full
    elsewhere = tmp_path_factory.mktemp("elsewhere") / "case.yaml"
    save_case(full, elsewhere, defaults=True)
    moved = load_case(elsewhere)
    assert moved.reference_file(moved.reference["decay"].curve.file).is_file()
    plain, original = moved.to_dict(True), full.to_dict(True)
    for data in (plain, original):
        del data["reference"]["decay"]["curve"]["file"], data["reference"]["profile"]["curves"]["file"]
    assert plain == original
    assert dump_case(full) == dump_case(load_case(folder / "copy.yaml"))
    with pytest.raises(OutputError):
        save_case(full, folder)


scalars = (
    st.none()
    | st.booleans()
    | st.integers(-(10**9), 10**9)
    | st.floats(allow_nan=False)
    | st.text(max_size=12)
)
tricky = st.sampled_from(
    "1e3 0o7 0x1F ~ null yes no on true .inf 1_000 2/52 2024-01-01 1:30 é".split()
    + "- #x *a &a !t @ ` % ' \" [ { a,b \\ = <<".split()
    + ["", " ", "a: b", "x #y", "\n", "\t", "where(x<1, 2, 3) > 1", "\x85", "\u2028", "\ufeff"]
)


@settings(max_examples=150, deadline=None, derandomize=True)
@given(
    st.dictionaries(
        st.text(min_size=1, max_size=5) | tricky,
        st.recursive(
            scalars | tricky,
            lambda inner: (
                st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=4) | tricky, inner, max_size=3)
            ),
            max_leaves=6,
        ),
        max_size=3,
    )
)
def test_written_data_is_read_back(data):
    assert read_yaml(dump_yaml(data)) == data


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("1e-3", 1e-3),
        ("on", "on"),
        ("yes", "yes"),
        ("010", 10),
        ("0o10", 8),
        ("1.", 1.0),
        (".5", 0.5),
        ("1_0", "1_0"),
        ("2/52", "2/52"),
        ("~", None),
        ("", None),
        ("true", True),
        ("'1'", "1"),
        ("1:30", "1:30"),
        ("2024-01-01", "2024-01-01"),
        ("-.inf", float("-inf")),
        ("+12", 12),
    ],
)
def test_core_schema(text, value):
    result = read_yaml(f"x: {text}")["x"]
    assert result == value and type(result) is type(value)


# ---- errors ----------------------------------------------------------------------------------------------


def test_exit_codes():
    errors = [
        (WarpsphError("x"), 1),
        (CaseError([]), 2),
        (DivergenceError("x", particle=3, time=0.5, quantity="velocity"), 3),
        (OutputError("x"), 4),
        (CapacityError("x", key="numerics.skin"), 5),
        (WallTimeReached("x"), 7),
        (Interrupted("x"), 130),
    ]
    for error, code in errors:
        assert error.exit_code == code
        assert isinstance(error, WarpsphError)
        twin = pickle.loads(pickle.dumps(error))
        assert str(twin) == str(error)
        assert vars(twin) == vars(error)
    assert "numerics.neighbour_capacity" in str(CapacityError("full"))
