"""Which platforms an FMU is compiled for, as the command line says it."""

from __future__ import annotations

from dataclasses import dataclass

from ..declare import nearest
from ..native.compilers import TARGETS, Compiler, CompilerError, compiler_for, this_platform
from .finding import BuildError

# Not a platform: the Python body, for all those that nothing is compiled for.
PYTHON = "python"


@dataclass(frozen=True)
class Native:
    """What a compiled FMU holds.

    Attributes:
        targets: platforms of FMI 2.0.
        python: whether it runs in Python on all others.
        key: platforms and compilers, or why there is none, for a cache.
    """

    targets: tuple[str, ...]
    python: bool
    key: str


def native_targets(text: str | None = None) -> Native:
    """The platforms that a text such as ``linux64,win64`` names; without one that of this computer.

    Raises:
        BuildError: unknown name.
    """
    names = [this_platform()] if text is None else [name.strip() for name in text.split(",")]
    for name in names:
        if name not in (*TARGETS, PYTHON):
            known = ", ".join((*TARGETS, PYTHON))
            hint = nearest(name, (*TARGETS, PYTHON)) or f"; there are {known}"
            raise BuildError(f"no platform '{name}' to compile for{hint}")
    targets = tuple(sorted({name for name in names if name != PYTHON}))
    if not targets:
        raise BuildError(f"no platform to compile for; there are {', '.join(TARGETS)}")
    python = PYTHON in names
    return Native(targets, python, repr((targets, python, [_compiler(target) for target in targets])))


def _compiler(target: str) -> Compiler | str:
    """The compiler for a platform; without one the reason, as the FMU may come with the package."""
    try:
        return compiler_for(target)
    except CompilerError as error:
        return str(error)
