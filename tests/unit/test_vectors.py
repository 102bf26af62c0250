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
from warpsph.case.case import Case
from warpsph.running.model import Model
model = Model(Case.from_dict(json.loads(sys.argv[1])), threads=1)
model.stepper.prepare(fresh=True)
model.stepper.run(1.0, 1)
"""
# The lengths of the pairs of a loop are square roots: of several numbers at once, or of one.
PACKED = re.compile(r"\bv?(?:sqrtp[sd]|rsqrt14p[sd])\b")


@pytest.mark.parametrize("scene", SCENES)
def test_pair_loops_of_the_sweeps_are_vectors(scene, tmp_path):
    case = {
        "dimension": 2,
        "particle_spacing": 0.1,
        "end_time": 1.0,
        "phases": {"water": WATER},
        "output": {"particles": "none", "checkpoint": "none"},
        **SCENES[scene],
    }
    environment = {**os.environ, "WARP_CACHE_PATH": str(tmp_path)}
    subprocess.run([sys.executable, "-c", BUILD, json.dumps(case)], env=environment, check=True, capture_output=True)
    for sweep in ("continuity", "momentum"):
        (code,) = tmp_path.glob(f"**/*make_*{sweep}__locals__*{sweep}_*/*.o")
        listing = subprocess.run(["objdump", "-d", "--no-show-raw-insn", code], check=True, capture_output=True, text=True)
        assert PACKED.search(listing.stdout), f"{sweep} works on one neighbour at a time"
