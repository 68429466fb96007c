"""The physics of ships and their control laws, each with an FMI 2.0 face.

A component is one module: NamedTuples of parameters, state, inputs and outputs, two pure functions
``init`` and ``step``, and a :class:`~fmus.declare.Component` that names them. Everything an FMU
shows of itself (variables, units, dependencies) comes from that declaration.

``python -m fmus.build`` makes the FMUs; from Python ``fmus.build_fmus(["vessel"])``.
"""

from importlib import import_module

# Public name -> module and name in it. Imported on demand: each FMU carries this file.
_HOME = {
    "Component": ("declare", "Component"),
    "Memory": ("effects", "Memory"),
    "Range": ("declare", "Range"),
    "Search": ("effects", "Search"),
    "Ship": ("ship", "Ship"),
    "Wording": ("effects", "Wording"),
    "build_fmus": ("build", "build"),
    "effect": ("effects", "effect"),
    "make_ship": ("ship", "ship"),
}
__all__ = sorted(_HOME)  # pyright: ignore[reportUnsupportedDunderAll]


def __getattr__(name: str) -> object:
    if name not in _HOME:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    module, inside = _HOME[name]
    return getattr(import_module(f".{module}", __name__), inside)


def __dir__() -> list[str]:
    return sorted(_HOME)
