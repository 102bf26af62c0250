"""The schemes by name. Light: no import of Warp or a kernel; the file of a scheme is imported when it is asked for.

A program adds a scheme of its own with `register`, before it loads a case that names it.
"""

from __future__ import annotations

import importlib

from warpsph.schemes.base import Scheme

__all__ = ["DEFAULT", "find", "names", "register", "unregister"]

DEFAULT = "riemann"
"""Scheme of a case that names none."""

# name -> the class of the scheme, as module:class
_BUILT_IN = {
    "riemann": "warpsph.schemes.riemann_scheme:RiemannScheme",
    "isph": "warpsph.schemes.isph_scheme:IsphScheme",
    "delta_plus": "warpsph.schemes.delta_scheme:DeltaScheme",
    "gas": "warpsph.schemes.gas_scheme:GasScheme",
}
_known: dict[str, Scheme] = {}


def register(scheme: Scheme) -> None:
    """Make a scheme known under its name.

    Raises ValueError if another scheme has the name.
    """
    if scheme.name in _BUILT_IN or _known.get(scheme.name, scheme) is not scheme:
        raise ValueError(f"there is a scheme {scheme.name!r} already; choose another name")
    _known[scheme.name] = scheme


def unregister(name: str) -> None:
    """Forget a scheme that was registered. Raises KeyError if there is none of that name, or it is one of the package."""
    if name in _BUILT_IN:
        raise KeyError(f"scheme {name!r} belongs to the package")
    del _known[name]


def find(name: str) -> Scheme:
    """Return the scheme of a name. Raises KeyError if there is none."""
    if name not in _known:
        if name not in _BUILT_IN:
            raise KeyError(f"there is no scheme {name!r}; the schemes are {', '.join(names())}")
        module, _, attribute = _BUILT_IN[name].partition(":")
        _known[name] = getattr(importlib.import_module(module), attribute)()
    return _known[name]


def names() -> tuple[str, ...]:
    """Return the names of all schemes: those of this package first, then in the order of their registration."""
    return (*_BUILT_IN, *(name for name in _known if name not in _BUILT_IN))
