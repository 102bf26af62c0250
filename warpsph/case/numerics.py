"""The section `numerics` of a case: what all schemes read, and the choice of the model by `numerics.scheme`.

Each scheme has a model of its own (`warpsph/schemes/*_numerics.py`), so that a key of another scheme is an unknown key.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, Field, GetCoreSchemaHandler, GetJsonSchemaHandler
from pydantic_core import CoreSchema, core_schema

from warpsph.case.values import CaseModel, ChoiceRule, NumberRule, bad_value, suggestion
from warpsph.schemes import registry

__all__ = ["SUPPORT_RATIO", "Auto", "ByScheme", "NumericsBase", "Switch", "default_numerics", "one_of_switch"]

SUPPORT_RATIO = {
    "wendland_c2": 2.0, "wendland_c4": 2.0, "wendland_c6": 2.0, "cubic": 2.0, "quintic": 3.0, "gaussian": 3.0,
}  # fmt: skip
"""Support radius of each smoothing kernel divided by h."""

Auto = Literal["auto"]


def one_of_switch(*names: str) -> BeforeValidator:
    """Return the check that a value is true, false, auto or one of `names`."""
    words = ("auto", *names)

    def check(value: Any) -> Any:
        if value is True or value is False or (isinstance(value, str) and value in words):
            return value
        raise bad_value(f"needs true, false{', '.join(('', *words[:-1]))} or {words[-1]}")

    return BeforeValidator(check)


Switch = Annotated[bool | Auto, one_of_switch()]
"""true, false or auto."""


def _as_scheme(value: Any) -> str:
    known = registry.names()
    if isinstance(value, str) and value in known:
        return value
    needs = f"needs one of {', '.join(known)}"
    raise bad_value(f"has no value; {needs}") if value is None else bad_value(needs, suggestion(value, known))


RENAMED = {"surface_filter": "velocity_filter"}
"""names that keys had before, and those that they have"""


class NumericsBase(CaseModel):
    """How it is computed: the keys of every scheme. `formulation` sets the defaults of the keys that are `auto`.

    The model of a scheme inherits from this one and gives `scheme` its own name as default.
    """

    scheme: Annotated[str, BeforeValidator(_as_scheme)] = Field(
        description="name of the scheme; the other keys of numerics are those of the scheme", examples=["isph"]
    )
    formulation: Annotated[Literal["improved", "paper"], ChoiceRule()] = Field(
        default="improved",
        description="the improved formulation or the one printed in the paper",
        examples=["improved"],
    )
    pressure_gradient: Annotated[Literal["auto", "corrected", "conservative"], ChoiceRule()] = Field(
        default="auto",
        description="corrected: minus form, exact for linear pressure; conservative: plus form, conserves momentum",
        examples=["auto"],
    )
    viscosity_form: Annotated[Literal["auto", "morris", "radial", "isotropic", "paper"], ChoiceRule()] = Field(
        default="auto", description="viscous term", examples=["auto"]
    )
    kernel: Annotated[
        Literal["wendland_c2", "wendland_c4", "wendland_c6", "cubic", "quintic", "gaussian"], ChoiceRule()
    ] = Field(default="wendland_c2", description="smoothing kernel", examples=["wendland_c2"])
    smoothing_ratio: Annotated[float | Auto, NumberRule(least=0.8, most=4, auto=True)] = Field(
        default="auto", description="smoothing length h divided by particle_spacing", examples=["1.5"]
    )
    shifting: Annotated[float | Auto, NumberRule(least=0, most=20, auto=True)] = Field(
        default="auto", description="coefficient of particle shifting", examples=["16"]
    )
    unlock: Annotated[float | Auto, NumberRule(least=0, most=0.3, auto=True)] = Field(
        default="auto",
        description="random displacement at the start that breaks the symmetry of a lattice, fraction of "
        "particle_spacing; start.noise counts if it is larger",
        examples=["0"],
    )
    courant: Annotated[float | Auto, NumberRule(above=0, most=2, auto=True)] = Field(
        default="auto", description="time step divided by h over the largest speed", examples=["0.5"]
    )
    skin: Annotated[float | Auto, NumberRule(least=0.03, most=1, auto=True)] = Field(
        default="auto",
        description="skin of the neighbour list, fraction of the support radius",
        examples=["0.1"],
    )
    neighbour_capacity: Annotated[int | Auto, NumberRule(least=4, most=100_000, integer=True, auto=True)] = Field(
        default="auto", description="room for neighbours of one particle", examples=["64"]
    )
    maximum_step: Annotated[float | None, NumberRule(above=0, none=True)] = Field(
        default=None, description="upper limit of the time step, s; none: no limit", examples=["1e-3"]
    )

    @classmethod
    def model_for(cls, raw: Any) -> type[CaseModel]:
        """The model of the scheme that a section as written names; of all schemes, if it names none that exists."""
        name = _name_in(raw)
        return registry.find(name).numerics if name in registry.names() else NumericsBase

    @classmethod
    def models(cls) -> list[type[CaseModel]]:
        """The models of all schemes."""
        return [registry.find(name).numerics for name in registry.names()]

    @classmethod
    def foreign_key(cls, key: str, raw: Any) -> tuple[str, str] | None:
        """Rule and remedy for a key of another scheme, or of an older name."""
        if key in RENAMED:
            return f"is called {RENAMED[key]} now", f"write {RENAMED[key]}"
        owners = [name for name in registry.names() if key in registry.find(name).numerics.model_fields]
        if not owners:
            return None
        rule = f"is a choice of scheme: {' or '.join(owners)}, the case has scheme: {_name_in(raw)}"
        return rule, f"delete it, or write scheme: {owners[0]}"


def _name_in(raw: Any) -> Any:
    """The scheme that a section as written names."""
    return raw.get("scheme", registry.DEFAULT) if isinstance(raw, Mapping) else registry.DEFAULT


def default_numerics() -> NumericsBase:
    """The section of a case that has none."""
    return registry.find(registry.DEFAULT).numerics.model_validate({})


class ByScheme:
    """Annotation of a field that holds the numerics of a scheme: its key `scheme` says which model reads it."""

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        return core_schema.no_info_plain_validator_function(
            self._validate, metadata={"pydantic_js_functions": [lambda _s, inner: self._schema(inner)]}
        )

    @staticmethod
    def _validate(value: Any) -> NumericsBase:
        if isinstance(value, NumericsBase):
            return value
        if not isinstance(value, Mapping):
            return NumericsBase.model_validate(value)  # says what is wrong
        model = NumericsBase.model_for(value)
        if model is not NumericsBase:
            return model.model_validate(value)  # type: ignore[return-value]
        # What a key of some scheme holds cannot be judged while the scheme is unknown.
        keys = {key for model in NumericsBase.models() for key in model.model_fields}
        special = keys - set(NumericsBase.model_fields)
        return NumericsBase.model_validate({key: entry for key, entry in value.items() if key not in special})

    @staticmethod
    def _schema(handler: GetJsonSchemaHandler) -> dict[str, Any]:
        options = []
        for name in registry.names():
            scheme = registry.find(name)
            option = handler(scheme.numerics.__pydantic_core_schema__)
            written = handler.resolve_ref_schema(option)
            written["properties"]["scheme"] = {"const": name, "description": scheme.summary, "examples": [name]}
            # That of the default scheme alone may be left out, so that one option fits, not several.
            others = [key for key in written.get("required", []) if key != "scheme"]
            written["required"] = others if name == registry.DEFAULT else [*others, "scheme"]
            options.append(option)
        return {"oneOf": options}
