"""The section `output` of a case, and what it has in common with gauges: times."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, Self

from pydantic import Field, ModelWrapValidatorHandler, model_validator

from warpsph.case.values import (
    AlsoWritten,
    CaseModel,
    NumberRule,
    PositiveNumber,
    Times,
    bad_value,
    example,
    field_list,
    schema_of_fields,
)

PARTICLE_FIELDS = (
    "velocity", "density", "pressure", "mass", "volume", "phase", "particle_spacing", "particle_id",
    "acceleration", "normal", "curvature", "vorticity", "q_criterion",
)  # fmt: skip
"""Fields that particle output may hold (positions are always written)."""


class Timed(CaseModel):
    """Something that happens every `interval` or at given `times`; exactly one of both."""

    interval: PositiveNumber | None = Field(
        default=None, description="time between outputs, s", examples=["0.1"]
    )
    times: Times | None = Field(
        default=None, description="times of the outputs, s, rising", examples=["[0.1, 0.2]"]
    )

    @model_validator(mode="wrap")
    @classmethod
    def _has_times(cls, value: Any, handler: ModelWrapValidatorHandler[Self]) -> Self:
        if isinstance(value, Mapping):
            for key in ("interval", "times"):
                if key in value and value[key] is None:
                    raise bad_value(
                        f"{key} has no value", f"write e.g. {key}: {example(cls.model_fields[key])}"
                    )
        result = handler(value)
        if (result.interval is None) == (result.times is None):
            # A misspelt key has been reported by the handler before this is reached.
            which = "both" if result.times is not None else "neither"
            raise bad_value(f"needs either interval or times, has {which}", "write e.g. interval: 0.1")
        return result


class ParticleOutput(Timed):
    """Particle files."""

    fields: Annotated[tuple[str, ...], field_list(PARTICLE_FIELDS), schema_of_fields(PARTICLE_FIELDS)] = (
        Field(
            default=("velocity", "density", "pressure", "mass", "phase"),
            description="fields to write",
            examples=["[velocity, pressure]"],
        )
    )
    compress: bool = Field(default=False, description="compress the files with zlib, without loss", examples=["true"])


class CheckpointOutput(CaseModel):
    """Files from which a run can be continued."""

    interval: PositiveNumber = Field(description="simulated time between checkpoints, s", examples=["1"])
    keep: Annotated[int, NumberRule(least=1, most=1_000_000, integer=True)] = Field(
        default=3, description="how many of the last ones are kept", examples=["3"]
    )


DIRECTIONS = ("backward", "forward")
MOST_STARTS = 16  # windows at once: each costs memory and work on every particle


class LyapunovOutput(CaseModel):
    """Finite-time Lyapunov exponents of the flow, as fields of the particle files."""

    window: PositiveNumber = Field(description="time over which the fluid is followed, s", examples=["2.0"])
    starts: Annotated[int, NumberRule(least=1, most=MOST_STARTS, integer=True)] = Field(
        default=4, description="windows that run at once; one begins every window/starts", examples=["4"]
    )
    direction: Annotated[tuple[str, ...], field_list(DIRECTIONS), schema_of_fields(DIRECTIONS)] = Field(
        default=("backward",),
        description="backward: how far apart neighbours were (attracting structures); forward: how far apart what was "
        "together is now (repelling ones)",
        examples=["[backward, forward]"],
    )

    @property
    def fields(self) -> tuple[str, ...]:
        """Names of the fields in particle files."""
        return (*(f"ftle_{name}" for name in self.direction), "ftle_age", "ftle_way")


def _none_word(value: Any) -> Any:
    """`none` switches an output off."""
    return None if isinstance(value, str) and value == "none" else value


class Output(CaseModel):
    """What is written beside the gauges. Each part may be `none`."""

    particles: Annotated[ParticleOutput | None, AlsoWritten(_none_word, {"const": "none"})] = Field(
        default=None,
        description="particle files; none: not written (default: 20 times a run)",
        examples=["{interval: 0.1}"],
    )
    checkpoint: Annotated[CheckpointOutput | None, AlsoWritten(_none_word, {"const": "none"})] = Field(
        default=None,
        description="restart files; none: not written (default: 10 times a run)",
        examples=["{interval: 0.5}"],
    )
    lyapunov: Annotated[LyapunovOutput | None, AlsoWritten(_none_word, {"const": "none"})] = Field(
        default=None,
        description="Lyapunov exponents in the particle files (default: none)",
        examples=["{window: 2.0}"],
    )
