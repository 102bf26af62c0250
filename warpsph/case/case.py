"""The case: everything a run needs to know, validated and frozen.

A case is a tree of pydantic models whose attributes mirror the keys of the YAML file. `Case.from_dict` (and
`warpsph.case.case_file.load_case`, which reads YAML) is the only door; it gathers every problem of the input and
raises one CaseError with all of them. Checking happens in two layers:

1. the fields, in a file a section: type, range, spelling. Each field's description states its unit and meaning;
2. the checks between fields, in checks.py. They also run on whatever part of a faulty case could be
   read, so that one look shows all that is wrong.

Numbers may be written as arithmetic text ("2/52"). A key whose value is `auto` is chosen later.
"""

from __future__ import annotations

import copy
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any, Literal, Self

from pydantic import (
    BaseModel,
    BeforeValidator,
    Field,
    ModelWrapValidatorHandler,
    PrivateAttr,
    StrictStr,
    ValidationError,
    ValidationInfo,
    model_validator,
)

from warpsph.case.bodies import Body
from warpsph.case.checks import cross_check
from warpsph.case.domain import AXES, AxisBoundary, Domain
from warpsph.case.drafts import draft
from warpsph.case.expressions import compile_expression
from warpsph.case.gauge_models import Gauge
from warpsph.case.initial import CentralForce, Scales, Start
from warpsph.case.numerics import ByScheme, NumericsBase, default_numerics
from warpsph.case.outputs import CheckpointOutput, Output, ParticleOutput
from warpsph.case.phases import Fluid, Phase, SurfaceTension
from warpsph.case.plain import files_named, none_words, rename_files, set_path
from warpsph.case.references import Reference, ReferenceInterface
from warpsph.case.reports import in_order, report
from warpsph.case.signals import SignalVector, bound_to, signals_of
from warpsph.case.validation_runs import Validation
from warpsph.case.values import (
    CaseModel,
    ChoiceRule,
    FreezeMapping,
    FrozenDict,
    Name,
    PositiveNumber,
    as_list,
)
from warpsph.case.yaml_text import Tree, apply_override, placed, read_file
from warpsph.errors import CaseError, Problem
from warpsph.schemes import registry
from warpsph.schemes.base import Scheme


class Case(CaseModel):
    """A complete, validated, immutable description of a run. SI units throughout."""

    title: StrictStr = Field(default="", description="one line for people", examples=['"my case"'])
    description: StrictStr = Field(
        default="", description="longer text for people", examples=['"what to look at"']
    )
    dimension: Annotated[Literal[1, 2, 3], ChoiceRule()] = Field(
        description="number of space dimensions; 1 with scheme: gas alone", examples=["2"]
    )
    particle_spacing: PositiveNumber = Field(
        description="distance of particles at the start, m", examples=["0.01"]
    )
    end_time: PositiveNumber = Field(description="simulated time at which the run ends, s", examples=["1.0"])
    precision: Annotated[Literal["float32", "float64"], ChoiceRule()] = Field(
        default="float32", description="floating point numbers of the computation", examples=["float32"]
    )
    domain: Domain = Field(
        description="the box in which the particles live", examples=["{lower: [0, 0], upper: [1, 1]}"]
    )
    gravity: SignalVector = Field(
        default=(), description="gravity, m/s^2; may depend on time (default zero)", examples=["[0, -9.81]"]
    )
    body_force: SignalVector = Field(
        default=(),
        description="further acceleration of the fluid, m/s^2; may depend on time. Along an axis with a wall at a side it "
        "counts as gravity, elsewhere it drives a flow and no pressure (default zero)",
        examples=["[1e-4, 0]"],
    )
    central_force: CentralForce | None = Field(
        default=None, description="acceleration towards a point", examples=["{rate: 100}"]
    )
    phases: Annotated[Mapping[Name, Phase], Field(min_length=1), FreezeMapping()] = Field(
        description="the fluids by name, in the order of their index", examples=["{water: {density: 1000}}"]
    )
    surface_tension: Annotated[tuple[SurfaceTension, ...], BeforeValidator(as_list)] = Field(
        default=(),
        description="surface tension of pairs of phases",
        examples=["[{between: [gas, liquid], coefficient: 1}]"],
    )
    fluids: Annotated[tuple[Fluid, ...], Field(min_length=1), BeforeValidator(as_list)] = Field(
        description="which phase is where", examples=["[{phase: water, shape: rest}]"]
    )
    bodies: Annotated[Mapping[Name, Body], FreezeMapping()] = Field(
        default_factory=FrozenDict,
        description="solids by name, with surfaces that do not follow the lattice",
        examples=["{cylinder: {shape: {sphere: {center: [0, 0], radius: 1}}}}"],
    )
    start: Start = Field(default_factory=Start, description="state at time 0", examples=["{noise: 0.2}"])
    scales: Scales = Field(
        default_factory=Scales, description="what the flow will see", examples=["{velocity: 1}"]
    )
    numerics: Annotated[NumericsBase, ByScheme()] = Field(
        default_factory=default_numerics, description="how it is computed", examples=["{skin: 0.1}"]
    )
    output: Output = Field(
        default_factory=Output, description="files", examples=["{particles: {interval: 0.1}}"]
    )
    gauges: Annotated[Mapping[Name, Gauge], FreezeMapping()] = Field(
        default_factory=FrozenDict,
        description="time series by name",
        examples=["{energy: {type: energy, interval: 0.1}}"],
    )
    reference: Annotated[Mapping[Name, Reference], FreezeMapping()] = Field(
        default_factory=FrozenDict,
        description="comparisons with references by name",
        examples=["{decay: {gauge: energy, column: kinetic, reduce: final, value: 1}}"],
    )
    validation: Validation = Field(
        default_factory=Validation,
        description="runs of the command validate",
        examples=['{seed: [{name: "100", changes: {particle_spacing: 2/100}}]}'],
    )

    _source_folder: Path | None = PrivateAttr(None)

    @model_validator(mode="wrap")
    @classmethod
    def _all_problems_at_once(
        cls, value: Any, handler: ModelWrapValidatorHandler[Self], info: ValidationInfo
    ) -> Self:
        if isinstance(value, Case):
            return handler(value)
        context = info.context if isinstance(info.context, Mapping) else {}
        folder = context.get("source_folder")
        if not isinstance(value, Mapping):
            raise CaseError([Problem("(case)", value, "needs a mapping of keys", "write e.g. dimension: 2")])
        try:
            case = handler(value)
        except ValidationError as error:
            problems = report(error, cls, value)
            problems += cross_check(draft(cls, value), folder, value)
            raise CaseError(in_order(problems, cls)) from None
        case._source_folder = folder
        for _, signal in signals_of(case):
            bound_to(folder, signal)
        case._fill_defaults()
        found = cross_check(case, folder, value)
        if found:
            raise CaseError(in_order(found, cls))
        return case

    def _fill_defaults(self) -> None:
        """Fill in the defaults that depend on dimension and end time; they stay `not set by the user`."""
        zero = (0.0,) * self.dimension

        def fill(model: BaseModel, name: str, default: Any) -> None:
            if name not in model.model_fields_set:
                object.__setattr__(model, name, default)
                model.model_fields_set.discard(name)

        fill(self, "gravity", zero)
        fill(self, "body_force", zero)
        if self.central_force is not None:
            fill(self.central_force, "center", zero)
        fill(self.start, "velocity", (compile_expression("0.0"),) * self.dimension)
        for body in self.bodies.values():
            if body.motion is not None:
                fill(body.motion, "translation", zero)
                fill(body.motion, "pivot", zero)
        for reference in self.reference.values():
            if isinstance(reference, ReferenceInterface):
                fill(reference.interface, "offset", zero)
        for axis in AXES:
            for side in (
                getattr(self.domain.boundary, axis).lower,
                getattr(self.domain.boundary, axis).upper,
            ):
                if not side.velocity:
                    object.__setattr__(side, "velocity", zero)
        fill(self.output, "particles", ParticleOutput(interval=self.end_time / 20))
        fill(self.output, "checkpoint", CheckpointOutput(interval=self.end_time / 10))

    @classmethod
    def foreign_key(cls, key: str, raw: Any) -> tuple[str, str] | None:
        """Rule and remedy for a section that the case no longer has."""
        if key == "obstacles":
            return "is now called bodies, a mapping of names", "write bodies: {name: {shape: ..., wall: ...}}"
        return None

    # -- making cases ------------------------------------------------------------

    @classmethod
    def from_dict(cls, data: Mapping[str, Any], source_folder: Path | str | None = None) -> Case:
        """The case that the plain mapping `data` describes (keys as in a case file).

        source_folder: where relative reference files are looked up; None skips the look-up.
        Raises CaseError with all problems.
        """
        folder = Path(source_folder) if source_folder is not None else None
        return cls.model_validate(data, context={"source_folder": folder})

    @classmethod
    def load(cls, path: Path | str | Mapping[str, Any], overrides: Sequence[str] = ()) -> Case:
        """Read, change and validate a case.

        path: a case file, or the nested plain data that one would hold, `{"dimension": 2, ...}`; reference files of the
            latter are looked up in the current folder.
        overrides: texts `a.b=c` that replace what the file says; the path is dotted, list positions are numbers,
            the value is YAML (`domain.lower=[0, 0]`).

        Returns the validated Case; its `source_folder` is the folder of the file.
        Raises CaseError with all problems, line and column where they are known.
        """
        if isinstance(path, Mapping):
            tree, folder = Tree(copy.deepcopy(dict(path)) if overrides else path), Path.cwd()
        else:
            tree, folder = read_file(Path(path)), Path(path).parent
        problems = list(tree.problems)
        overridden: list[str] = []
        for override in overrides:
            try:
                overridden.append(apply_override(tree.data, override))
            except CaseError as error:
                problems += error.problems
        try:
            case = cls.from_dict(tree.data, folder)
        except CaseError as error:
            problems += [placed(problem, tree.places, overridden) for problem in error.problems]
        if problems:
            raise CaseError(problems)
        return case

    def replace(self, changes: Mapping[str, Any]) -> Case:
        """A copy with other values, e.g. `case.replace({"numerics.courant": 0.3, "phases.gas.density": 2})`.

        Keys are dotted paths, list positions are numbers (`fluids.0.phase`); None takes an entry of `reference`
        or `gauges` out (`{"reference.jump": None}`). The copy is validated like any case. Raises CaseError.
        """
        data = self.to_dict()
        problems = []
        for path, value in changes.items():
            try:
                set_path(data, path, value)
            except CaseError as error:
                problems += error.problems
        if problems:
            raise CaseError(problems)
        return type(self).from_dict(data, self.source_folder)

    def to_dict(self, defaults: bool = False) -> dict[str, Any]:
        """Plain dicts, lists, numbers and text as in a case file; `defaults` adds what the user left out.

        `Case.from_dict(case.to_dict(), case.source_folder) == case` holds.
        """
        plain = self.model_dump(mode="python", by_alias=True, exclude_unset=not defaults)
        if self.dimension < 3 and defaults:
            for axis in AXES[self.dimension :]:
                del plain["domain"]["boundary"][axis]
            for body in plain["bodies"].values():
                if isinstance(body.get("motion"), dict):
                    body["motion"].pop("axis", None)
        result: dict[str, Any] = none_words(plain)
        return result

    def resolved(self, known: Mapping[str, Any]) -> dict[str, Any]:
        """`to_dict(defaults=True)` with what `auto` came to.

        known: dotted path -> value, as a scheme decides them (`numerics.shifting`, `phases.water.sound_speed` ...).
            Reference files get absolute paths, so that the result can be stored in another folder.
        """
        data = self.to_dict(defaults=True)
        data.pop("validation", None)  # says nothing about this run
        self.make_files_absolute(data)
        for path, value in known.items():
            set_path(data, path, value)
        return data

    def make_files_absolute(self, data: dict[str, Any]) -> None:
        """Turn the names of files in a plain case into absolute paths, in place."""
        if self.source_folder is not None:
            rename_files(data, {name: str(path.resolve()) for name, path in self.reference_files.items()})

    @property
    def reference_files(self) -> dict[str, Path]:
        """Path of each file that the case names, references and tables of signals, by the name that the case has for it."""
        return {name: self.reference_file(name) for name in files_named(self.to_dict())}

    # -- short cuts ------------------------------------------------------------

    @property
    def source_folder(self) -> Path | None:
        """Folder of the case file; relative reference files are looked up there. None if there is no file."""
        return self._source_folder

    @property
    def spacing(self) -> float:
        """particle_spacing, m."""
        return self.particle_spacing

    @property
    def phase_names(self) -> list[str]:
        """Names of the phases in the order of their index."""
        return list(self.phases)

    @property
    def sides(self) -> tuple[AxisBoundary, ...]:
        """The sides of the domain, one entry an axis of this dimension."""
        return tuple(getattr(self.domain.boundary, axis) for axis in AXES[: self.dimension])

    @property
    def scheme(self) -> Scheme:
        """The scheme that `numerics.scheme` names."""
        return registry.find(self.numerics.scheme)

    @property
    def periodic(self) -> tuple[bool, ...]:
        """Whether each axis is periodic."""
        return tuple(axis.periodic for axis in self.sides)

    @property
    def has_walls(self) -> bool:
        """Whether there are wall particles: a wall at a side, or a body."""
        return bool(self.bodies) or any(
            "wall" in (axis.lower.kind, axis.upper.kind) for axis in self.sides
        )

    @property
    def has_open_sides(self) -> bool:
        """Whether any side of the domain is open."""
        return any("open" in (axis.lower.kind, axis.upper.kind) for axis in self.sides)

    @property
    def has_flow_through(self) -> bool:
        """Whether any side of the domain is an inlet or an outlet."""
        return any(end.flow is not None for axis in self.sides for end in (axis.lower, axis.upper))

    @property
    def has_surface_tension(self) -> bool:
        """Whether any pair of phases has a surface tension above zero."""
        return any(pair.coefficient > 0 for pair in self.surface_tension)

    def reference_file(self, name: str) -> Path:
        """Path of a reference file: an absolute name as it is, others within `source_folder`."""
        return (self.source_folder or Path()) / name


def case_schema() -> dict[str, Any]:
    """JSON schema (draft 2020-12) of case files, for completion and checks in editors."""
    schema = Case.model_json_schema(by_alias=True, mode="validation")
    schema["$schema"] = "https://json-schema.org/draft/2020-12/schema"
    schema["title"] = "warpsph case"
    return schema
