"""Checks between fields: the domain, its sides, and vectors everywhere."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

from warpsph.case.checking import check_corners, check_length, each, extent_of
from warpsph.case.domain import AXES, AxisBoundary
from warpsph.case.drafts import Problems
from warpsph.case.numerics import SUPPORT_RATIO
from warpsph.case.places import dig
from warpsph.case.signals import check_signal, signal_text, signals_of
from warpsph.errors import MISSING, Problem

_AUTO_SUPPORT = 2 * 1.5
"""Support radius in particle spacings that is assumed while `smoothing_ratio` is `auto`."""

_MOST_PARTICLES = 2**31 - 1


def _vectors(case: Any) -> Iterator[tuple[str, Callable[[], Any]]]:
    """Path and value of every vector of the case, each read only when asked for."""
    yield "domain.lower", lambda: case.domain.lower
    yield "domain.upper", lambda: case.domain.upper
    yield "gravity", lambda: case.gravity
    yield "body_force", lambda: case.body_force
    if getattr(case, "central_force", None) is not None:
        yield "central_force.center", lambda: case.central_force.center
    yield "start.velocity", lambda: case.start.velocity


def check_vectors(case: Any, _folder: Path | None, _raw: Any) -> Problems:
    def check(dimension: int, path: str, read: Callable[[], Any]) -> Problems:
        yield from check_length(dimension, path, read())

    yield from each(check, _vectors(case), case.dimension)


def check_domain(case: Any, _folder: Path | None, _raw: Any) -> Problems:
    yield from check_corners(case.dimension, "domain", case.domain.lower, case.domain.upper)
    extent = extent_of(case)
    if extent is None:
        return
    spacing = case.particle_spacing
    short = [axis for axis, length in zip(AXES, extent, strict=False) if length < 1.999 * spacing]
    if short:
        yield Problem(
            "particle_spacing",
            spacing,
            f"leaves no room for two particles along {', '.join(short)}",
            f"write at most {min(extent) / 2:.4g}, or enlarge the domain",
        )
    count = math.prod(length / spacing for length in extent)
    if count > _MOST_PARTICLES:
        told = f"{count:.3g}" if math.isfinite(count) else "more than 1e308"
        # by logarithms: the volume of a domain may be beyond what a number holds
        fitting = math.exp((sum(map(math.log, extent)) - math.log(_MOST_PARTICLES)) / len(extent))
        yield Problem(
            "particle_spacing",
            spacing,
            f"makes {told} particles in the domain, at most 2^31 - 1",
            f"write at least {fitting * 1.01:.4g}",
        )


def check_signals(case: Any, folder: Path | None, _raw: Any) -> Problems:
    for path, signal in signals_of(case):
        if not path.startswith("bodies."):  # told with the other keys of their motion
            yield from check_signal(path, signal, folder, case.end_time)


def check_boundary(case: Any, _folder: Path | None, raw: Any) -> Problems:
    known = case.scheme.dimensions
    if case.dimension not in known:
        rule = f"is not known to scheme: {case.scheme.name}, which has {' and '.join(map(str, known))}"
        yield Problem("dimension", case.dimension, rule, f"write dimension: {known[0]}, or scheme: gas")
    for axis in AXES[case.dimension :]:
        written = dig(raw, "domain", "boundary", axis)
        if written is not MISSING:
            rule = f"has no {axis} axis (dimension: {case.dimension})"
            yield Problem(f"domain.boundary.{axis}", written, rule, "delete it")
    yield from each(_check_axis, [(position,) for position in range(case.dimension)], case, raw)


def _check_axis(case: Any, raw: Any, position: int) -> Problems:
    axis = AXES[position]
    boundary = getattr(case.domain.boundary, axis)
    dimension = case.dimension
    written = dig(raw, "domain", "boundary", axis)
    apart = isinstance(written, AxisBoundary) or bool(
        isinstance(written, Mapping) and {"lower", "upper"} & written.keys()
    )
    for name in ("lower", "upper") if apart else ("lower",):
        side = getattr(boundary, name)
        path = f"domain.boundary.{axis}.{name}.velocity" if apart else f"domain.boundary.{axis}.velocity"
        yield from check_length(dimension, path, side.velocity)
        if len(side.velocity) == dimension and side.velocity[position] != 0:
            yield Problem(
                path,
                [signal_text(value) for value in side.velocity],
                f"moves the wall out of its plane ({axis} has to be 0)",
                "let domain walls slide in their own plane only",
            )
    if boundary.periodic:
        extent = extent_of(case)
        if extent is not None:
            ratio = case.numerics.smoothing_ratio
            spacing = case.particle_spacing
            support = (
                _AUTO_SUPPORT if ratio == "auto" else ratio * SUPPORT_RATIO[case.numerics.kernel]
            ) * spacing
            if extent[position] < 2 * support * (1 - 1e-9):
                yield Problem(
                    f"domain.boundary.{axis}",
                    "periodic",
                    f"needs a box of at least twice the support radius "
                    f"along {axis}: {2 * support:.4g} m, has {extent[position]:.4g} m",
                    "enlarge the domain or lower particle_spacing",
                )
