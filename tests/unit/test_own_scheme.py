"""A scheme and a gauge added from outside of the package: heat conduction between particles, by rates and Runge-Kutta."""

import ast
import functools
import math
from pathlib import Path
from typing import Any, Literal

import numpy as np
import pytest
import warp as wp
from pydantic import Field as Key

from warpsph import Simulation
from warpsph.case.case import Case
from warpsph.case.columns import Column
from warpsph.case.gauge_models import GaugeModel
from warpsph.case.numerics import NumericsBase
from warpsph.engine import integrators
from warpsph.engine.program import BuildList, KeepList, Program, Stage
from warpsph.kernels.core.clock import make_advance
from warpsph.kernels.core.fields import COMMON, FLOW, Field, always
from warpsph.kernels.core.pair import WRAPPED, list_access, separation_of
from warpsph.kernels.core.params import make_params
from warpsph.kernels.core.smoothing import make_smoothing
from warpsph.kernels.core.spec import Spec, types_of
from warpsph.kernels.core.updates import make_watch
from warpsph.measure import gauges
from warpsph.measure.gauge import Gauge, Needs
from warpsph.scene.physics import Physics, smoothing_ratio, support_radius
from warpsph.schemes import registry
from warpsph.schemes.base import Scheme

TEMPERATURE = Field("temperature", "real", "fluid", True, always, "K", "of a particle")
HEATING = Field("heating", "real", "fluid", False, always, "K/s", "its rate")
REST_VOLUME = next(field for field in FLOW if field.name == "rest_volume")


@functools.cache
def make_conduction(spec: Spec) -> Any:
    """Return the kernel dT_i/dt = 2 kappa sum_j (T_i - T_j) W'/r V_j."""
    real, vec, _, _ = types_of(spec)
    Params = make_params(spec.dimension, spec.precision)
    _, slope = make_smoothing(spec.kernel, spec.precision)
    separation = separation_of(spec)
    list_begin, list_step, neighbour, Listed = list_access(spec)

    @wp.kernel(module="unique", enable_backward=False)
    def conduct(
        first: int,
        particle_count: int,
        list_width: int,
        conductivity: real,
        params: Params,
        neighbours: Listed,
        fluid_neighbours: wp.array(dtype=wp.int16),
        flags: wp.array(dtype=wp.uint8),
        position: wp.array(dtype=vec),
        rest_volume: wp.array(dtype=real),
        temperature: wp.array(dtype=real),
        heating: wp.array(dtype=real),
    ):
        i = wp.tid() + first
        wrapped = (int(flags[i]) & WRAPPED) != 0
        total = real(0.0)
        k = list_begin(i, list_width)
        step = list_step(particle_count)
        end = k + int(fluid_neighbours[i]) * step
        while k < end:
            j = neighbour(neighbours, i, k)
            k += step
            d = separation(position[i], position[j], wrapped, params)
            q = wp.sqrt(wp.dot(d, d)) * params.inv_h
            total += (temperature[i] - temperature[j]) * params.g_norm * slope(q) * rest_volume[j]
        heating[i] = real(2.0) * conductivity * total

    return conduct


class HeatNumerics(NumericsBase):
    """Keys of the scheme."""

    scheme: str = "heat"
    conductivity: float = Key(default=1.0, description="kappa, m^2/s", examples=["1"])
    integrator: Literal["rk4", "rk2"] = Key(default="rk4", description="Runge-Kutta method", examples=["rk4"])


class Heat(Scheme):
    """Particles at rest that exchange heat."""

    name = "heat"
    summary = "heat conduction between particles at rest"
    numerics = HeatNumerics
    shown = ("temperature",)

    def fields(self):
        """A temperature, its rate, and what Runge-Kutta keeps of it."""
        return [*COMMON, REST_VOLUME, TEMPERATURE, HEATING, *integrators.work_fields([TEMPERATURE])]

    def derive(self, case, geometry, row_list):
        """Half of the step that an explicit method bears, or the case's."""
        h = smoothing_ratio(case) * case.spacing
        limit = case.numerics.maximum_step or 0.1 * h * h / case.numerics.conductivity
        spec = Spec(
            dimension=case.dimension, precision=case.precision, periodic=tuple(case.periodic), scheme="heat",
            kernel=case.numerics.kernel, row_list=row_list,
        )  # fmt: skip
        return Physics(
            spec=spec, reasons={}, h=h, support=support_radius(case),
            choices={"courant": 1.0, "skin": 0.1, "unlock": 0.0, "integrator": case.numerics.integrator},
            sound_speed=(1.0,), scales={"velocity": 0.0}, step_cap={"conduction": limit}, densities=(1.0,),
            tension=np.zeros((1, 1)),
        )  # fmt: skip

    def fill(self, population, case, geometry, physics):
        """A wave of temperature."""
        fluid = geometry.fluid_count
        population.put("rest_volume", geometry.volume[:fluid])
        population.put("temperature", np.sin(2 * math.pi * geometry.position[:fluid, 0]))

    def values(self, params, case, geometry, physics, device):
        """The conductivity."""
        return {"conductivity": types_of(physics.spec).real(case.numerics.conductivity)}

    def program(self, spec, choices):
        """Rates, Runge-Kutta, clock."""
        rates = [Stage("conduct", make_conduction(spec), "fluid", "heat from the neighbours")]
        advance = Stage("advance", make_advance(spec.precision), "one", "time")
        watch = Stage("watch", make_watch(spec), "fluid", "faults")
        method = {"rk4": integrators.rk4, "rk2": integrators.rk2}[choices["integrator"]]
        step = [*method(spec, {"heating": TEMPERATURE}, rates), watch, advance, KeepList()]
        return Program(step=step, start=[BuildList("the first list")], advance=advance)


class HeatModel(GaugeModel):
    """Section of the gauge."""

    type: Literal["heat"] = Key(description="mean and largest temperature")


class HeatGauge(Gauge):
    """Mean and largest temperature."""

    needs = Needs.of(fields=["volume"])

    @property
    def columns(self):
        """Two."""
        return [Column("mean", "K"), Column("largest", "K")]

    def row(self, snapshot):
        """Of a snapshot."""
        fluid = snapshot.fluid
        temperature = fluid.own["temperature"]
        return [float(np.average(temperature, weights=fluid.volume)), float(temperature.max())]



@pytest.fixture(autouse=True, scope="module")
def known():
    """The scheme and the gauge, for the tests of this file."""
    registry.register(Heat())
    gauges.register(HeatModel, HeatGauge)
    yield
    registry.unregister("heat")
    gauges.unregister("heat")


CASE = {
    "dimension": 2,
    "precision": "float64",
    "particle_spacing": 1 / 32,
    "end_time": 0.02,
    "domain": {"lower": [0, 0], "upper": [1, 1], "boundary": {"x": "periodic", "y": "periodic"}},
    "phases": {"plate": {"density": 1.0}},
    "fluids": [{"phase": "plate", "shape": "rest"}],
    "start": {"arrangement": "lattice"},
    "numerics": {"scheme": "heat"},
    "gauges": {"heat": {"type": "heat", "interval": 0.005}},
}


def run(device, folder=None, **changes):
    """A run to its end."""
    return Simulation(Case.from_dict(CASE).replace(changes), output=folder, device=device, threads=1).run()


def test_a_wave_of_temperature_decays(device, tmp_path):
    """At the rate of the discrete operator on a lattice, which is near 4 pi^2; its mean stays; the gauge is written."""
    found = run(device, tmp_path / "run")
    heat = found.gauge("heat")
    assert len(heat["time"]) == 5 and np.abs(heat["mean"]).max() < 1e-12
    rate = -np.log(heat["largest"][1:] / heat["largest"][0]) / heat["time"][1:]
    np.testing.assert_allclose(rate, rate[0], rtol=1e-6)  # a pure exponential: the wave is an eigenvector
    assert rate[0] == pytest.approx(4 * math.pi**2, rel=0.03)
    text = (tmp_path / "run" / "gauges" / "heat.csv").read_text()
    assert text.startswith("time [s],mean [K],largest [K]")
    assert "scheme: heat" in (tmp_path / "run" / "case.yaml").read_text()


@pytest.mark.parametrize("integrator, order", [("rk4", 4), ("rk2", 2)])
def test_order_in_time(integrator, order, device):
    """Errors of steps of dt, dt/2 against dt/16."""
    spacing = 1 / 32
    longest = 0.3 * spacing**2 * 1.5**2

    def end(step):
        numerics = {"numerics.integrator": integrator, "numerics.maximum_step": step, "gauges": {}}
        return run(device, end_time=16 * longest, **numerics).state.own["temperature"]

    exact, coarse, fine = (end(longest / n) for n in (16, 1, 2))
    found = math.log2(np.abs(coarse - exact).max() / np.abs(fine - exact).max())
    assert found == pytest.approx(order, abs=0.35)


def test_wrong_keys_are_told(device):
    """Keys of other schemes are unknown, and the error says whose they are."""
    from warpsph.errors import CaseError

    with pytest.raises(CaseError, match="room_rate"):
        Case.from_dict({**CASE, "numerics": {"scheme": "heat", "room_rate": 1}})
    with pytest.raises(CaseError, match="heat"):
        Case.from_dict({**CASE, "numerics": {"scheme": "hat"}})


def test_a_misspelt_array_is_refused_before_anything_compiles(device):
    """Warp would bind nothing to it, and read beyond its end."""
    real = wp.float64

    @wp.kernel(module="unique", enable_backward=False)
    def broken(first: int, temprature: wp.array(dtype=real), heating: wp.array(dtype=real)):
        heating[wp.tid() + first] = temprature[wp.tid() + first]

    class Broken(Heat):
        def program(self, spec, choices):
            program = super().program(spec, choices)
            return Program([Stage("broken", broken, "fluid", ""), *program.step], program.start, program.advance)

    simulation = Simulation(Case.from_dict(CASE), device=device, threads=1)
    stepper = simulation.model.stepper
    stepper.scheme = Broken()
    with pytest.raises(KeyError, match="temprature.*did you mean 'temperature'"):
        stepper._bind()


def test_a_field_that_nobody_writes_is_refused(device):
    """The stage and the field are named."""

    class Idle(Heat):
        def program(self, spec, choices):
            program = super().program(spec, choices)
            step = [node for node in program.step if node.name != "conduct"]
            return Program(step, program.start, program.advance)

    stepper = Simulation(Case.from_dict(CASE), device=device, threads=1).model.stepper
    stepper.scheme = Idle()
    with pytest.raises(KeyError, match="try temperature.*'heating'"):
        stepper._bind()


def test_nobody_asks_which_scheme_runs():
    """No file of the package compares the name of a scheme, beside the schemes themselves."""
    root = Path(__file__).resolve().parents[2]
    names = {"riemann", "isph", "delta_plus", "gas"}
    found = []
    for path in [*(root / "warpsph").rglob("*.py"), *(root / "kernels").rglob("*.py")]:
        if path.parent.name == "schemes":
            continue
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Compare):
                told = [part.value for part in ast.walk(node) if isinstance(part, ast.Constant)]
                if names.intersection(text for text in told if isinstance(text, str)):
                    found.append(f"{path.relative_to(root)}:{node.lineno}")
    assert not found
