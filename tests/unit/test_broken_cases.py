"""Broken case files by the hundred: each is refused with a CaseError, or accepted if harmless."""

import copy
import random
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from warpsph.case.case_file import load_case, read_yaml
from warpsph.errors import CaseError

VALID = """\
title: Drop in a channel
dimension: 2
particle_spacing: "1/20"
end_time: 2.0
precision: float64
domain:
  lower: [0, 0]
  upper: [2, 1]
  boundary: {x: periodic, y: {lower: wall, upper: {wall: no_slip, velocity: [1, 0]}}}
gravity: [0, -1]
body_force: [0.1, 0]
phases:
  oil: {density: 900, viscosity: 0.1, sound_speed: auto, gamma: 7, background_pressure: 0}
  water: {density: 1000, viscosity: 0.01, sound_speed: 20}
surface_tension:
  - {between: [oil, water], coefficient: 0.5}
fluids:
  - {phase: oil, shape: {sphere: {center: [1, 0.5], radius: 0.2}}}
  - {phase: oil, shape: {where: {condition: "x < 0.2 and y > 0.5"}}}
  - {phase: water, shape: rest}
bodies:
  block: {shape: {box: {lower: [1.5, 0.1], upper: [1.7, 0.3]}}, hollow: false, wall: no_slip}
start: {noise: 0.1, seed: 3, velocity: ["sin(pi*y)", 0], pressure: none}
scales: {velocity: 1, length: auto, pressure: auto}
numerics: {formulation: improved, kernel: quintic, smoothing_ratio: 1.2, courant: 0.4, maximum_step: none}
output:
  particles: {interval: 0.5, fields: [velocity, pressure]}
  checkpoint: {interval: 1, keep: 2}
gauges:
  energy: {type: energy, interval: 0.1}
  load: {type: wall_force, interval: 0.1}
  probe: {type: points, points: [[0, 0.5], [1, 0.5]], fields: [pressure], interval: 0.1}
  line: {type: line, from: [0, 0], to: [0, 1], count: 11, fields: [velocity], times: [0.5, 1]}
reference:
  final: {gauge: energy, column: kinetic, reduce: final, window: [1, 2], value: 0.3, allowed: 0.1}
  curve: {gauge: energy, column: kinetic, curve: {file: ref.csv, time: t, value: v}, norm: rms}
  lines: {gauge: line, column: velocity_x, curves: {file: ref.csv, position: t, columns: {0.5: v, 1: w}}}
  formula: {particles: last, field: velocity, exact: ["exp(-t)", 0], norm: max}
"""

# Text in VALID, what stands there instead, and the path (or a part of the message) of the problem it makes.
HAND_MADE = [
    # values of the wrong kind
    ("dimension: 2", "dimension: two", "dimension"),
    ("dimension: 2", "dimension: 2.5", "dimension"),
    ("dimension: 2", "dimension: [2]", "dimension"),
    ("dimension: 2", "dimension: {a: 2}", "dimension"),
    ("dimension: 2", "dimension:", "dimension"),
    ("dimension: 2", "dimension: true", "dimension"),
    ("dimension: 2", "dimension: 1", "dimension"),
    ("dimension: 2", "dimension: 3", "domain.lower"),
    ('"1/20"', "1/0", "particle_spacing"),
    ('"1/20"', "0", "particle_spacing"),
    ('"1/20"', "-0.05", "particle_spacing"),
    ('"1/20"', ".nan", "particle_spacing"),
    ('"1/20"', ".inf", "particle_spacing"),
    ('"1/20"', "1e400", "particle_spacing"),
    ('"1/20"', "9" * 390, "particle_spacing"),
    ('"1/20"', "0x", "particle_spacing"),
    ('"1/20"', "5 cm", "particle_spacing"),
    ('"1/20"', "0,05", "particle_spacing"),
    ('"1/20"', "9**9**9", "particle_spacing"),
    ('"1/20"', "__import__('os').system('true')", "particle_spacing"),
    ('"1/20"', "5", "particle_spacing"),
    ('"1/20"', "1e-12", "particle_spacing"),
    ("end_time: 2.0", "end_time: forever", "end_time"),
    ("end_time: 2.0", "end_time: -1", "end_time"),
    ("end_time: 2.0", "endtime: 2.0", "endtime"),
    ("end_time: 2.0", "", "end_time"),
    ("end_time: 2.0", "end_time: 2.0\nend_time: 3.0", "end_time"),
    ("end_time: 2.0", "end_time: 1e12", "output.particles.interval"),
    ("precision: float64", "precision: double", "precision"),
    ("precision: float64", "precision: 64", "precision"),
    ("title: Drop in a channel", "title: [a]", "title"),
    ("title: Drop in a channel", "title: Drop: in a channel", "not YAML"),
    # domain
    ("lower: [0, 0]\n", "lower: [0]\n", "domain.lower"),
    ("lower: [0, 0]\n", "lower: [0, 0, 0]\n", "domain.lower"),
    ("lower: [0, 0]\n", "lower: 0\n", "domain.lower"),
    ("lower: [0, 0]\n", "lower: [a, b]\n", "domain.lower.0"),
    ("lower: [0, 0]\n", "lower: [0, [0]]\n", "domain.lower.1"),
    ("lower: [0, 0]\n", "lower: [0, ]\n", "domain.lower"),
    ("lower: [0, 0]\n", "lower: {x: 0, y: 0}\n", "domain.lower"),
    ("lower: [0, 0]\n", "lower: [3, 0]\n", "domain.upper"),
    ("upper: [2, 1]", "upper: [0.2, 1]", "domain.boundary.x"),
    ("upper: [2, 1]", "upper: [1e308, 1]", "particle_spacing"),
    ("upper: [2, 1]", "uper: [2, 1]", "domain.uper"),
    ("x: periodic", "x: priodic", "domain.boundary.x"),
    ("x: periodic", "x: {lower: periodic, upper: open}", "domain.boundary.x.lower"),
    ("x: periodic", "x: {lower: periodic}", "domain.boundary.x.lower"),
    ("x: periodic", "x: 5", "domain.boundary.x"),
    ("x: periodic", "x: {wall: sticky}", "domain.boundary.x.wall"),
    ("x: periodic", "x: {wall: no_slip, velocity: [1, 0]}", "domain.boundary.x.velocity"),
    ("x: periodic", "x: {lower: wall, uper: wall}", "domain.boundary.x.uper"),
    ("x: periodic", "w: periodic", "domain.boundary.w"),
    ("x: periodic", "x: periodic, z: open", "domain.boundary.z"),
    ("x: periodic", "x: {<kind>: open, wall: no_slip}", "domain.boundary.x.<kind>"),
    ("velocity: [1, 0]}}}", "velocity: [1, 1]}}}", "domain.boundary.y.upper.velocity"),
    ("velocity: [1, 0]}}}", "velocity: [1]}}}", "domain.boundary.y.upper.velocity"),
    ("{x: periodic, y:", "[x, y]\nz: {y:", "domain.boundary"),
    ("gravity: [0, -1]", "gravity: -1", "gravity"),
    ("gravity: [0, -1]", "gravity: [0, -1, 0]", "gravity"),
    ("gravity: [0, -1]", "gravity: [0, yes]", "gravity.1"),
    ("gravity: [0, -1]", "gravity: down", "gravity"),
    # phases
    ("density: 900", "density: -900", "phases.oil.density"),
    ("density: 900", "density: 0", "phases.oil.density"),
    ("density: 900", "density: heavy", "phases.oil.density"),
    ("density: 900", "densty: 900", "phases.oil.densty"),
    ("density: 900, ", "", "phases.oil.density"),
    ("viscosity: 0.1", "viscosity: -0.1", "phases.oil.viscosity"),
    ("viscosity: 0.1", "viscosity: none", "phases.oil.viscosity"),
    ("sound_speed: auto", "sound_speed: 0", "phases.oil.sound_speed"),
    ("sound_speed: auto", "sound_speed: Auto", "phases.oil.sound_speed"),
    ("gamma: 7", "gamma: 0", "phases.oil.gamma"),
    ("  oil: {", "  1: {", "phases.1"),
    ("  oil: {", "  oil drop: {", "phases.oil drop"),
    ("  oil: {", "  ? [a]\n  : {", "key"),
    ("  oil: {", "  gas: {", "fluids.0.phase"),
    ("  oil: {", "  water: {", "phases.water"),
    ("phases:", "phase:", "phase"),
    # surface tension
    ("between: [oil, water]", "between: [oil]", "surface_tension.0.between"),
    ("between: [oil, water]", "between: [oil, oil]", "surface_tension.0.between"),
    ("between: [oil, water]", "between: [oil, gas]", "surface_tension.0.between.1"),
    ("between: [oil, water]", "between: oil", "surface_tension.0.between"),
    ("between: [oil, water]", "between: [1, 2]", "surface_tension.0.between.0"),
    ("coefficient: 0.5", "coefficient: -0.5", "surface_tension.0.coefficient"),
    (
        "  - {between",
        "  - {between: [water, oil], coefficient: 1}\n  - {between",
        "surface_tension.1.between",
    ),
    ("surface_tension:\n  - ", "surface_tension:\n    ", "surface_tension"),
    # fluids and bodies
    ("{phase: oil, shape: {sphere", "{phase: oli, shape: {sphere", "fluids.0.phase"),
    ("{phase: oil, shape: {sphere", "{shape: {sphere", "fluids.0.phase"),
    ("{phase: oil, shape: {sphere", "{phase: [oil], shape: {sphere", "fluids.0.phase"),
    ("sphere: {center", "shpere: {center", "fluids.0.shape.shpere"),
    ("sphere: {center", "cube: {center", "fluids.0.shape"),
    ("center: [1, 0.5]", "center: [1]", "fluids.0.shape.sphere.center"),
    ("center: [1, 0.5]", "center: [9, 9]", "fluids.0.shape.sphere"),
    ("radius: 0.2", "radius: -0.2", "fluids.0.shape.sphere.radius"),
    ("radius: 0.2", "raduis: 0.2", "fluids.0.shape.sphere.raduis"),
    ('"x < 0.2 and y > 0.5"', '"x"', "fluids.1.shape.where.condition"),
    ('"x < 0.2 and y > 0.5"', '"x <"', "fluids.1.shape.where.condition"),
    ('"x < 0.2 and y > 0.5"', '"q < 0.2"', "fluids.1.shape.where.condition"),
    ('"x < 0.2 and y > 0.5"', '"z < 0.2"', "fluids.1.shape.where.condition"),
    ('"x < 0.2 and y > 0.5"', "5", "fluids.1.shape.where.condition"),
    ('"x < 0.2 and y > 0.5"', "[x < 1]", "fluids.1.shape.where.condition"),
    ('"x < 0.2 and y > 0.5"', '"().__class__.__bases__"', "fluids.1.shape.where.condition"),
    ('"x < 0.2 and y > 0.5"', "'" + "(" * 500 + "'", "fluids.1.shape.where.condition"),
    ('"x < 0.2 and y > 0.5"', '"' + "not " * 490 + 'x"', "fluids.1.shape.where.condition"),
    ("shape: rest}", "shape: rst}", "fluids.2.shape"),
    ("shape: rest}", "shape: {rest: }}", "fluids.2.shape"),
    ("shape: rest}", "shape: box}", "fluids.2.shape"),
    ("shape: rest}", "shape: rest}\n  - {phase: oil, shape: rest}", "fluids.2.shape"),
    ("box: {lower: [1.5, 0.1]", "box: {lower: [1.8, 0.1]", "bodies.block.shape.box.upper"),
    ("box: {lower: [1.5, 0.1]", "box: {lower: [1.5]", "bodies.block.shape.box.lower"),
    ("shape: {box: {lower: [1.5, 0.1], upper: [1.7, 0.3]}}", "shape: rest", "bodies.block.shape"),
    ("shape: {box: {lower: [1.5, 0.1], upper: [1.7, 0.3]}}", "shape: {box: }", "bodies.block.shape"),
    ("wall: no_slip}", "wall: slippery}", "bodies.block.wall"),
    ("hollow: false", "hollow: maybe", "bodies.block.hollow"),
    ("block: {", "my block: {", "bodies.my block"),
    # start, scales, numerics
    ("noise: 0.1", "noise: 0.5", "start.noise"),
    ("noise: 0.1", "niose: 0.1", "start.niose"),
    ("seed: 3", "seed: 3.5", "start.seed"),
    ("seed: 3", "seed: -3", "start.seed"),
    ('["sin(pi*y)", 0]', '["sin(pi*z)", 0]', "start.velocity.0"),
    ('["sin(pi*y)", 0]', '["sine(pi*y)", 0]', "start.velocity.0"),
    ('["sin(pi*y)", 0]', '["sin(pi*y)"]', "start.velocity"),
    ('["sin(pi*y)", 0]', '"sin(pi*y)"', "start.velocity"),
    ('["sin(pi*y)", 0]', "[true, 0]", "start.velocity.0"),
    ('["sin(pi*y)", 0]', '["1/0", 0]', "start.velocity.0"),
    ("pressure: none}", "pressure: high}", "start.pressure"),
    ("pressure: none}", "pressure: [1]}", "start.pressure"),
    ("scales: {velocity: 1", "scales: {velocity: 0", "scales.velocity"),
    ("scales: {velocity: 1", "scales: {speed: 1", "scales.speed"),
    ("kernel: quintic", "kernel: quartic", "numerics.kernel"),
    ("kernel: quintic", "kernel: 5", "numerics.kernel"),
    ("smoothing_ratio: 1.2", "smoothing_ratio: 0.1", "numerics.smoothing_ratio"),
    ("smoothing_ratio: 1.2", "smoothing_ratio: 3.9, shifting: x", "numerics.shifting"),
    ("courant: 0.4", "courant: -0.4", "numerics.courant"),
    ("courant: 0.4", "Courant: 0.4", "numerics.Courant"),
    ("maximum_step: none", "maximum_step: 0", "numerics.maximum_step"),
    ("maximum_step: none", "volume_constraint: maybe", "numerics.volume_constraint"),
    ("formulation: improved", "formulation: best", "numerics.formulation"),
    ("numerics: {", "numerics: [", "not YAML"),
    # output and gauges
    ("fields: [velocity, pressure]}", "fields: [velocity, presure]}", "output.particles.fields"),
    ("fields: [velocity, pressure]}", "fields: velocity}", "output.particles.fields"),
    ("fields: [velocity, pressure]}", "fields: [[velocity]]}", "output.particles.fields"),
    ("fields: [velocity, pressure]}", "fields: [{velocity: 1}]}", "output.particles.fields"),
    ("particles: {interval: 0.5", "particles: {interval: 0", "output.particles.interval"),
    ("particles: {interval: 0.5", "particles: {times: [2, 1]", "output.particles.times"),
    ("particles: {interval: 0.5", "particles: {times: [1], interval: 1", "output.particles"),
    ("particles: {interval: 0.5", "particles: {every: 0.5", "output.particles"),
    ("checkpoint: {interval: 1, keep: 2}", "checkpoint: 1", "output.checkpoint"),
    ("checkpoint: {interval: 1, keep: 2}", "checkpoint: {interval: 1, keep: 0}", "output.checkpoint.keep"),
    ("type: energy", "type: enrgy", "gauges.energy"),
    ("type: energy", "type: [energy]", "gauges.energy"),
    ("type: energy", "tpye: energy", "gauges.energy"),
    ("type: energy, interval: 0.1", "type: energy", "gauges.energy"),
    ("type: energy, interval: 0.1", "type: energy, interval: 0.1, fields: [x]", "gauges.energy.fields"),
    ("  energy: {type: energy, interval: 0.1}", "  energy:", "gauges.energy"),
    ("  energy: {type: energy", "  ../energy: {type: energy", "gauges.../energy"),
    ("points: [[0, 0.5], [1, 0.5]]", "points: [[0, 0.5], [1]]", "gauges.probe.points.1"),
    ("points: [[0, 0.5], [1, 0.5]]", "points: [0, 0.5]", "gauges.probe.points.0"),
    ("points: [[0, 0.5], [1, 0.5]]", "points: []", "gauges.probe.points"),
    ("from: [0, 0]", "form: [0, 0]", "gauges.line.form"),
    ("count: 11", "count: 1", "gauges.line.count"),
    ("count: 11", "count: many", "gauges.line.count"),
    ("to: [0, 1]", "to: [0, 0]", "gauges.line.to"),
    ("times: [0.5, 1]", "times: [0.5, 0.5]", "gauges.line.times"),
    ("times: [0.5, 1]", "times: [0.5]", "reference.lines.curves.columns"),
    # reference
    ("final: {gauge: energy", "final: {gauge: enrgy", "reference.final.gauge"),
    ("final: {gauge: energy", "final: {gage: energy", "reference.final.gage"),
    ("value: 0.3", "valeu: 0.3", "reference.final"),
    ("value: 0.3", "value: 0.3, curve: {}", "reference.final"),
    ("window: [1, 2]", "window: [2, 1]", "reference.final.window"),
    ("reduce: final", "reduce: last", "reference.final.reduce"),
    ("allowed: 0.1", "allowed: -0.1", "reference.final.allowed"),
    ("curve: {file: ref.csv", "curve: {file: nothing.csv", "reference.curve.curve.file"),
    ("curve: {file: ref.csv", "curve: {file: .", "reference.curve.curve.file"),
    ("curve: {file: ref.csv", 'curve: {file: "a\\0b"', "reference.curve.curve.file"),
    ("curve: {file: ref.csv", "curve: {file: 5", "reference.curve.curve.file"),
    ("time: t, value: v", "time: tt, value: v", "reference.curve.curve.time"),
    ("columns: {0.5: v, 1: w}", "columns: {0.5: v, 1: q}", "reference.lines.curves.columns.1"),
    ("columns: {0.5: v, 1: w}", "columns: {a: v}", "reference.lines.curves.columns"),
    ("columns: {0.5: v, 1: w}", "columns: {}", "reference.lines.curves.columns"),
    ("columns: {0.5: v, 1: w}", "columns: [v, w]", "reference.lines.curves.columns"),
    ("column: velocity_x", "column: velocity_z", "reference.lines.column"),
    ("particles: last", "particles: first", "reference.formula.particles"),
    ('["exp(-t)", 0]', '"exp(-t)"', "reference.formula.exact"),
    ('["exp(-t)", 0]', '["exp(-t)", q]', "reference.formula.exact.1"),
    # YAML
    ("gravity: [0, -1]", "\tgravity: [0, -1]", "tabs"),
    ("gravity: [0, -1]", "gravity: [0, -1", "not YAML"),
    ("gravity: [0, -1]", "gravity: *g", "aliases"),
    ("gravity: [0, -1]", "gravity: !!python/tuple [0, -1]", "tags"),
    ("gravity: [0, -1]", "gravity: 'x", "not YAML"),
    ("gravity: [0, -1]", "gravity: [0, -1]\n---\na: 1", "documents"),
    ("gravity: [0, -1]", "gravity: " + "[" * 60, "nested"),
    ("gravity: [0, -1]", "gravity: @home", "not YAML"),
    ("gravity: [0, -1]", "gravity: [0, -1]\n? {a: b}\n: 1", "key"),
    ("gravity: [0, -1]", "gravity: [0, -1]\n<<: {a: 1}", "<<"),
    ("gravity: [0, -1]", "gravity: [0, -1]\n  end: 1", "not YAML"),
    ("gravity: [0, -1]", "gravity: [0, -1]\n- 1", "not YAML"),
    ("gravity: [0, -1]", "gravity: [0, -1]\n\x07: 1", "not YAML"),
    ("gravity: [0, -1]", "gravity: [0, -1]\n5: 1", "5"),
    ("gravity: [0, -1]", "gravity: [0, -1]\n~: 1", "None"),
    ("gravity: [0, -1]", "gravity: [0, -1]\ngravity: [0, -1]", "second time"),
    ("gravity: [0, -1]", "%YAML 7.0\n---\ngravity: [0, -1]", "YAML"),
]

BOMB = "a: &a [x, x]\n" + "".join(
    f"{b}: &{b} [*{a}, *{a}, *{a}, *{a}]\n" for a, b in zip("abcdefghijklm", "bcdefghijklmn", strict=True)
)

WHOLE_FILES = [
    b"",
    b"\n\n",
    b"# only a comment\n",
    b"---\n",
    b"5",
    b"text",
    b"[1, 2]",
    b"- a\n- b\n",
    b"{}",
    b"null",
    b"a",
    b":",
    b"\xff\xfe\x00\x01",
    b"\x00" * 100,
    b"\x89PNG\r\n\x1a\n" + bytes(range(256)),
    bytes(range(256)) * 40,
    b"\xc3\x28",
    VALID.encode("utf-16"),
    VALID.encode().replace(b"\n", b"\n\t"),
    VALID.encode().replace(b": ", b":"),
    BOMB.encode(),
    b"[" * 5000,
    b"{a: " * 5000,
    b"- " * 5000,
    b"? " * 5000,
    b"!" * 5000,
    b"&" * 5000,
    b"'" * 5001,
    b'"\\',
    b"a: |\n" + b" \n" * 5000,
    b"%" * 50,
    b"%TAG ! !\n%TAG ! !\n---\na: 1",
    b"--- >\n---",
    b"...\n...",
    b"a: b: c: d",
    b"x" * 600_000,
    b"PK\x03\x04" + b"\0" * 30,
    b"<?xml version='1.0'?>",
    b'{"dimension": 2}',
    b"dimension = 2\n",
]


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "ref.csv").write_text("t,v,w\n0,1,2\n", encoding="utf-8")
    return tmp_path


def refused(folder: Path, content: str | bytes) -> CaseError | None:
    """The CaseError of a case file, None if it is accepted. Any other exception fails the test."""
    path = folder / "case.yaml"
    path.write_bytes(content.encode() if isinstance(content, str) else content)
    try:
        load_case(path)
    except CaseError as error:
        assert error.problems and error.exit_code == 2
        for problem, line in zip(error.problems, str(error).split("\n"), strict=False):
            assert problem.rule and problem.path
            assert line == str(problem), "one line a problem"
        return error
    return None


def test_the_valid_case_is_valid(folder: Path):
    assert refused(folder, VALID) is None


@pytest.mark.parametrize(("old", "new", "expected"), HAND_MADE, ids=range(len(HAND_MADE)))
def test_hand_made(folder: Path, old: str, new: str, expected: str):
    assert VALID.count(old) >= 1
    error = refused(folder, VALID.replace(old, new, 1))
    assert error is not None
    assert any(problem.path == expected for problem in error.problems) or expected in str(error), str(error)


def test_a_list_of_wrong_entries_is_not_called_empty(folder: Path):
    """One problem for each entry; a list without entries is one of its own."""
    for times, told in (("[-1, -2]", ["times.0", "times.1"]), ("[]", ["times"])):
        text = VALID.replace("energy: {type: energy, interval: 0.1}", f"energy: {{type: energy, times: {times}}}")
        (folder / "case.yaml").write_text(text)
        with pytest.raises(CaseError) as caught:
            load_case(folder / "case.yaml")
        assert [problem.path for problem in caught.value.problems] == [f"gauges.energy.{place}" for place in told]


def test_whole_files(folder: Path):
    for content in WHOLE_FILES:
        assert refused(folder, content) is not None, content[:40]


# ---- generated -------------------------------------------------------------------------------------------


def places(data: Any, path: tuple = ()) -> Iterator[tuple]:
    """Paths of all entries of nested dicts and lists."""
    items = data.items() if isinstance(data, dict) else enumerate(data) if isinstance(data, list) else ()
    for key, value in items:
        yield (*path, key)
        yield from places(value, (*path, key))


def dig(data: Any, path: tuple) -> Any:
    for key in path:
        data = data[key]
    return data


WRONG = [
    None,
    True,
    "",
    "text",
    "auto",
    "none",
    -1,
    0,
    1e300,
    float("nan"),
    float("inf"),
    10**30,
    [],
    {},
    [[]],
]
WRONG += [[None], {"a": 1}, {1: 2}, "1/0", "x", [1, 2, 3, 4], "rest", "z", 1.5, "9**9**9", [{"a": 1}, 2]]


def from_plain(folder: Path, data: Any) -> CaseError | None:
    """Refusal of plain data; through YAML for part of them would only repeat what the text tests do."""
    from warpsph.case.case import Case

    try:
        Case.from_dict(data, folder)
    except CaseError as error:
        assert error.problems
        assert len(str(error).split("\n")) == min(len(error.problems), 50) + (len(error.problems) > 50)
        return error
    return None


def test_wrong_values_everywhere(folder: Path):
    valid = read_yaml(VALID)
    count = refusals = 0
    for number, path in enumerate(places(valid)):
        # A third of the wrong values at each place; which third changes from place to place.
        for wrong in WRONG[number % 3 :: 3]:
            data = copy.deepcopy(valid)
            dig(data, path[:-1])[path[-1]] = copy.deepcopy(wrong)
            count += 1
            refusals += from_plain(folder, data) is not None
    assert count > 1000
    assert refusals > 0.8 * count


def test_misspelt_keys(folder: Path):
    valid = read_yaml(VALID)
    # Names that the user chooses can be spelt in any way, if they are used nowhere else.
    free = {("gauges", "load"), ("gauges", "probe"), ("bodies", "block")}
    free |= {("reference", name) for name in valid["reference"]}
    count = 0
    for path in list(places(valid)):
        key = path[-1]
        parent = dig(valid, path[:-1])
        if not isinstance(parent, dict) or not isinstance(key, str) or path in free:
            continue
        for wrong in (key + "x", key[1:] + "_", key.upper(), key[::-1] + "q"):
            data = copy.deepcopy(valid)
            dig(data, path[:-1])[wrong] = dig(data, path[:-1]).pop(key)
            error = from_plain(folder, data)
            assert error is not None, (path, wrong)
            count += 1
        # One letter too many is near enough for the right key to be named.
        data = copy.deepcopy(valid)
        dig(data, path[:-1])[key + "x"] = dig(data, path[:-1]).pop(key)
        assert key in str(from_plain(folder, data)), path
    assert count > 300


def test_removed_and_doubled_entries(folder: Path):
    valid = read_yaml(VALID)
    required = set(
        "dimension particle_spacing end_time domain phases fluids density phase shape between coefficient "
        "center radius condition type points from to count gauge column file position exact".split()
    )
    for path in list(places(valid)):
        data = copy.deepcopy(valid)
        parent = dig(data, path[:-1])
        if isinstance(parent, list):
            parent.insert(0, copy.deepcopy(parent[path[-1]]))
        else:
            del parent[path[-1]]
        error = from_plain(folder, data)
        if path[-1] in required:
            assert error is not None, path


def test_truncated_text(folder: Path):
    """A file that ends early, at every 7th byte."""
    accepted = [end for end in range(0, len(VALID), 7) if refused(folder, VALID[:end]) is None]
    # Only what ends after the last required section can be a case.
    assert all(end > VALID.index("bodies:") for end in accepted)


def test_damaged_text(folder: Path):
    """Random characters put in, taken out and swapped; the seed is fixed."""
    dice = random.Random(7)
    for _ in range(150):
        text = list(VALID)
        for _ in range(dice.randint(1, 4)):
            place = dice.randrange(len(text))
            match dice.randrange(3):
                case 0:
                    text.insert(place, dice.choice(" \n\t:-[]{},'\"#&*!|>%@`0aé\x00\u2028"))
                case 1:
                    del text[place]
                case _:
                    other = dice.randrange(len(text))
                    text[place], text[other] = text[other], text[place]
        refused(folder, "".join(text))


def test_damaged_lines(folder: Path):
    """Each line left out, repeated, or indented differently."""
    lines = VALID.split("\n")
    for number in range(len(lines)):
        refused(folder, "\n".join(lines[:number] + lines[number + 1 :]))
        refused(folder, "\n".join([*lines[:number], lines[number], *lines[number:]]))
        refused(folder, "\n".join([*lines[:number], " " + lines[number], *lines[number + 1 :]]))


OVERRIDES = [
    *("", "=", "=1", "a", "a.b.c=1", "domain=5", "domain.lower=[1]", "domain.lower.0=x", "domain.lower.9=1"),
    *(
        "domain.lower.x=1",
        "domain.lower.0.y=1",
        "phases.oil=",
        "..=1",
        "end_time=[",
        "end_time=*a",
        "end_time=!x 1",
    ),
    *(
        "end_time='",
        "fluids=none",
        "title={",
        "dimension=3",
        "numerics.kernel=cubicc",
        "end_time=1\n---\n2",
        "x\0y=1",
    ),
    *("é=1", "gauges.energy.type=none", "output.particles.interval.x=1", "end_time=\x00"),
]


@pytest.mark.parametrize("override", OVERRIDES)
def test_overrides(folder: Path, override: str):
    (folder / "case.yaml").write_text(VALID, encoding="utf-8")
    with pytest.raises(CaseError):
        load_case(folder / "case.yaml", [override])


def test_places_that_are_no_files(folder: Path):
    for path in (folder, folder / "none.yaml", folder / "ref.csv" / "x", "/dev/null", "a" * 5000, "", "a\0b"):
        with pytest.raises(CaseError) as caught:
            load_case(path)
        assert "\n" not in str(caught.value)


def test_missing_file_names_the_one_beside_it(folder: Path):
    (folder / "case.yaml").write_text(VALID, encoding="utf-8")
    with pytest.raises(CaseError, match=r"did you mean .*case\.yaml"):
        load_case(folder / "case.yml")


def test_at_least_200():
    assert len(HAND_MADE) + len(WHOLE_FILES) >= 200
