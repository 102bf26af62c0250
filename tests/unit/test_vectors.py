"""Loops over pairs of one phase become vectors of neighbours on a CPU (docs/records/pair_loops.md#vectors).

A branch, or a function that gives back a vector, in such a loop would cost half of its speed and change no result.
"""

import json
import os
import platform
import re
import shutil
import subprocess
import sys

import pytest

pytestmark = pytest.mark.skipif(
    platform.machine() not in ("x86_64", "AMD64") or shutil.which("objdump") is None,
    reason="reads machine code of x86 with objdump",
)

WATER = {"density": 1000.0, "sound_speed": 20.0}
OPEN = {"lower": [0, 0], "upper": [1, 1], "boundary": {"x": "free_slip", "y": {"lower": "free_slip", "upper": "open"}}}
PERIODIC = {"lower": [0, 0], "upper": [1, 1], "boundary": {"x": "periodic", "y": "periodic"}}
POOL = [{"phase": "water", "shape": {"box": {"lower": [0, 0], "upper": [1, 0.5]}}}]
REST = [{"phase": "water", "shape": "rest"}]
THICK = {"water": WATER | {"viscosity": 100.0}}
DELTA = {"scheme": "delta_plus"}
SCENES = {
    "surface": {"domain": OPEN, "fluids": POOL, "gravity": [0, -9.8]},
    "vortices": {"domain": PERIODIC, "fluids": REST, "phases": THICK},
    "two_fluids": {
        "domain": PERIODIC | {"boundary": {"x": "free_slip", "y": "free_slip"}},
        "fluids": [POOL[0], {"phase": "oil", "shape": "rest"}],
        "phases": {"water": WATER, "oil": WATER | {"density": 800.0}},
    },
    "delta": {"domain": PERIODIC, "fluids": REST, "numerics": DELTA, "phases": THICK},
    "delta_surface": {"domain": OPEN, "fluids": POOL, "gravity": [0, -9.8], "numerics": DELTA},
}
BUILD = """
import json, sys
from pathlib import Path
from warpsph.case.case import Case
from warpsph.running.model import Model
cache, scenes, seen, found = Path(sys.argv[1]), json.loads(sys.argv[2]), set(), {}
for name, case in scenes.items():
    model = Model(Case.from_dict(case), threads=1)
    model.stepper.prepare(fresh=True)
    model.stepper.run(1.0, 1)
    objects = {str(path) for path in cache.glob("**/*.o")}
    found[name], seen = sorted(objects - seen), objects
print(json.dumps(found))
"""
# The lengths of the pairs of a loop are square roots: of several numbers at once, or of one.
PACKED = re.compile(r"\bv?(?:sqrtp[sd]|rsqrt14p[sd])\b")


def test_pair_loops_of_the_sweeps_are_vectors(tmp_path):
    """All scenes in one process, which compiles anew: the sweeps of each are among what it compiled."""
    common = {
        "dimension": 2,
        "particle_spacing": 0.1,
        "end_time": 1.0,
        "phases": {"water": WATER},
        "output": {"particles": "none", "checkpoint": "none"},
    }
    scenes = json.dumps({name: {**common, **scene} for name, scene in SCENES.items()})
    environment = {**os.environ, "WARP_CACHE_PATH": str(tmp_path)}
    command = [sys.executable, "-c", BUILD, str(tmp_path), scenes]
    done = subprocess.run(command, env=environment, check=True, capture_output=True, text=True)
    compiled = json.loads(done.stdout.splitlines()[-1])
    assert compiled.keys() == SCENES.keys()
    for scene, objects in compiled.items():
        for sweep in ("continuity", "momentum"):
            name = re.compile(rf"make_\w*{sweep}__locals__\w*{sweep}_")
            (code,) = [path for path in objects if name.search(path)]
            command = ["objdump", "-d", "--no-show-raw-insn", code]
            listing = subprocess.run(command, check=True, capture_output=True, text=True)
            assert PACKED.search(listing.stdout), f"{scene}: {sweep} works on one neighbour at a time"
