"""Sets of effects: those of this project, and with a user's."""

import hashlib
import sys
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from types import ModuleType

from ..declare import DeclarationError, flatten, nearest
from ..hull_functions import FUNCTIONS
from ..scale import REFERENCE, Scale
from .effect import Effect, Kind, Loaded, Running, Thrust

ROOM = Path(__file__).parent


class EffectSet(Mapping[str, Effect]):
    """Effects by id, in the order of declaration; no two have an id or a parameter in common.

    Args:
        effects: the effects.
        files: users' files that some of them are from.
        general: the effects of every ship that those of a ship were made from; None: these are such.

    Attributes:
        timed: parameter that is a time within a run -> its effect.

    Raises:
        DeclarationError: an id or a parameter is declared twice.
    """

    def __init__(
        self,
        effects: Iterable[Effect],
        files: Iterable[Path] = (),
        general: "EffectSet | None" = None,
    ) -> None:
        self._effects: dict[str, Effect] = {}
        self.general = self if general is None else general
        self.files = tuple(files)
        taken: dict[str, str] = {}
        for e in effects:
            if e.id in self._effects:
                raise DeclarationError(f"there is an effect '{e.id}' already")
            for p in e.parameters:
                if p.name in taken:
                    owner = taken[p.name]
                    raise DeclarationError(f"'{p.name}' is a parameter of the effect '{owner}' already")
                taken[p.name] = e.id
            self._effects[e.id] = e
        self.timed = {name: e for e in self._effects.values() for name in e.search.times}
        self._kinds: dict[Kind, list[Effect]] = {}
        for e in self._effects.values():
            self._kinds.setdefault(e.kind, []).append(e)

    def __getitem__(self, name: str) -> Effect:
        if name not in self._effects:
            raise KeyError(f"no effect '{name}'{nearest(name, self._effects)}")
        return self._effects[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._effects)

    def __len__(self) -> int:
        return len(self._effects)

    def __eq__(self, other: object) -> bool:
        return self is other

    def __hash__(self) -> int:
        return id(self)

    def at(self, scale: Scale) -> "EffectSet":
        """The set for a ship of another size: starts, ranges and values to try by Froude's law."""
        if scale == REFERENCE:
            return self
        return EffectSet([_scaled(e, scale) for e in self.values()], self.files)

    def of_kind(self, *kinds: Kind) -> list[Effect]:
        """The effects of some kinds: kind by kind, in the order of declaration."""
        return [e for kind in kinds for e in self._kinds.get(kind, ())]

    def plus(self, effects: Iterable[Effect], file: Path | None = None) -> "EffectSet":
        """The set with further effects, of a user's file.

        Raises:
            DeclarationError: an id or a parameter is taken, a function does not give what its kind
                gives, or an effect is called linear and is not.
        """
        effects = list(effects)
        for e in effects:
            if e.kind == "force" and e.memory is None:
                _check_force(e)
            if e.linear and not is_linear(e):
                raise DeclarationError(
                    f"'{e.id}': twice the coefficient is not twice the effect; "
                    "declare it with linear=False"
                )
        return EffectSet([*self.values(), *effects], [*self.files, *([] if file is None else [file])])

    def plus_file(self, path: Path) -> "EffectSet":
        """The set with the effects of a user's file.

        Args:
            path: a Python file with functions decorated by :func:`fmus.effects.effect`, or with laws of
                actuators (:class:`fmus.actuators.law.Law`) or functions of the hull
                (:func:`fmus.hull_functions.hull_function`), which register themselves.

        Raises:
            DeclarationError: the file cannot be read, fails, or declares neither, or what is taken.
        """
        taken = {found.stem for found in (*ROOM.iterdir(), *self.files)}
        if not path.stem.isidentifier() or path.stem in taken:
            raise DeclarationError(f"'{path}': a file of effects cannot be called '{path.stem}'")
        if not path.is_file():
            raise DeclarationError(f"no such Python file of effects: '{path}'")
        # The same name may mean another file for another ship of this process.
        digest = hashlib.sha256(str(path.resolve()).encode() + path.read_bytes()).hexdigest()[:8]
        name = f"{__package__}.{path.stem}_{digest}"
        module = sys.modules.get(name) or _imported(name, path)
        found = effects_of(module)
        laws = [*filter(_is_law, vars(module).values()), *FUNCTIONS.values()]
        if not found and all(law.__module__ != name for law in laws):
            raise DeclarationError(
                f"'{path}' registers no effect; decorate a function with @effect(...)"
            )
        try:
            return self.plus(found, path)
        except DeclarationError as error:
            raise DeclarationError(f"'{path}': {error}") from error


def _is_law(value: object) -> bool:
    """Whether something is a law of actuators: a class that is registered among those of its kind."""
    return isinstance(value, type) and value in getattr(value, "known", {}).values()


def _scaled(e: Effect, scale: Scale) -> Effect:
    factors = {p.name: scale.factor(p.unit) for p in e.parameters}

    # Values that are made of the model in use have its size.
    tries = e.search.tries
    if not callable(tries):
        tries = [{name: factors[name] * x for name, x in values.items()} for values in tries]
    parameters = tuple(scale.of(p) for p in e.parameters)
    return replace(e, parameters=parameters, search=replace(e.search, tries=tries))


def _imported(name: str, path: Path) -> ModuleType:
    """The module of a user's file; no bytecode is kept beside it, which could be of an older one."""
    module = ModuleType(name)
    module.__file__, module.__package__ = str(path), __package__
    sys.modules[name] = module
    try:
        exec(compile(path.read_bytes(), str(path), "exec"), vars(module))
    except DeclarationError as error:
        del sys.modules[name]
        raise DeclarationError(f"'{path}': {error}") from error
    except (Exception, SystemExit) as error:
        del sys.modules[name]
        what = f"{error.msg}, line {error.lineno}" if isinstance(error, SyntaxError) else repr(error)
        raise DeclarationError(f"'{path}' fails when imported: {what}") from error
    return module


# Motion and thrust at which effects are compared, so large that squares and products all count; of more
# actuators than ships have.
_SIGNS = (1.0, -1.0)
_SIZES = tuple([0.7 - 0.05 * k if k % 2 else 0.05 * k - 0.6 for k in range(12)])


def _motion(sign: float) -> Loaded:
    u, v, r, t, *tau = [sign * x for x in (0.3, -0.2, 0.1, 7.0 * sign, 0.4, 0.6, -0.3)]
    return Loaded(1.0, 2.0, 0.5, u, v, r, t, tau[0], tau[1], tau[2])


def _running(sign: float) -> tuple[Thrust, Running]:
    X = tuple([sign * x for x in _SIZES])
    sizes = len(_SIZES) * (1.0,)
    thrust = Thrust(X, X[::-1], _SIZES, _SIZES[::-1], sizes)
    return thrust, Running(7.0, 0.3 * sign, -0.2 * sign, 0.1 * sign, X, X, sizes)


def _check_force(e: Effect) -> None:
    """Refuse a force that cannot be computed, acts on another axis, or where its coefficients are zero.

    Raises:
        DeclarationError: with what the function gets and gives.
    """
    values = {name: _unit(e, name) for name in e.coefficients}
    gets = ", ".join(f"ship.{name}" for name in Loaded._fields)
    form = f"a force gets {gets} and returns three numbers, X, Y and N"
    for sign in _SIGNS:
        try:
            found = _flat(e, (_motion(sign),), values)
            none = _flat(e, (_motion(sign),), {})
        except (AttributeError, TypeError) as error:
            raise DeclarationError(f"'{e.id}': {error}; {form}") from None
        except (ValueError, ArithmeticError):  # it has no value there
            continue
        if len(found) != len("XYN"):
            raise DeclarationError(f"'{e.id}' returns {len(found)} numbers; {form}")
        for axis, force in zip("XYN", found, strict=True):
            if force and axis not in e.axis:
                raise DeclarationError(
                    f"'{e.id}' returns a force on {axis}, and is declared for {e.axis}"
                )
        if any(none):
            zero = " and ".join(f"{name} = 0" for name in e.coefficients)
            raise DeclarationError(f"'{e.id}' returns a force with {zero}, where there is no effect")


def is_linear(e: Effect) -> bool:
    """Whether each coefficient's effect grows in proportion with it, as far as two motions show.

    Of effects with a memory, on inertia or on the measurement it is not known, and taken to be so.
    """
    if e.memory is not None or e.kind not in ("force", "environment", "actuator"):
        return True
    for sign in _SIGNS:
        at = _running(sign) if e.kind == "actuator" else (_motion(sign),)
        for name in e.coefficients:
            none, once, twice = (_flat(e, at, {name: k * _unit(e, name)}) for k in (0.0, 0.5, 1.0))
            size = max(abs(b - a) for a, b in zip(none, twice, strict=True))
            off = [abs(a - 2.0 * b + c) for a, b, c in zip(none, once, twice, strict=True)]
            if max(off) > 1e-6 * size:
                return False
        parts = [{name: 0.5 * _unit(e, name)} for name in e.coefficients]
        alone = [_flat(e, at, one) for one in ({}, *parts)]
        whole = _flat(e, at, {name: x for one in parts for name, x in one.items()})
        rest = [w - sum(p) + (len(parts) - 1) * n for w, n, *p in zip(whole, *alone, strict=True)]
        if max(map(abs, rest)) > 1e-6 * max(map(abs, whole)):
            return False
    return True


def _unit(e: Effect, name: str) -> float:
    """One, or the end of a coefficient's range if that is nearer."""
    limits = next(p.range for p in e.parameters if p.name == name)
    return 1.0 if limits.max is None else min(1.0, limits.max)


def _flat(e: Effect, at: tuple[object, ...], values: Mapping[str, float]) -> list[float]:
    """What an effect gives with some values of its parameters, as floats."""
    return flatten(e(*at, *[values.get(p.name, p.start) for p in e.parameters]))


def effects_of(module: ModuleType) -> list[Effect]:
    """The effects that a module declares, single ones and those in tuples, in the order of names."""
    found: dict[int, Effect] = {}
    for value in vars(module).values():
        for e in value if isinstance(value, tuple) else (value,):
            if isinstance(e, Effect) and _declared_in(e, module):
                found[id(e)] = e
    return list(found.values())


def _declared_in(e: Effect, module: ModuleType) -> bool:
    """Whether a module declares an effect, rather than imports it."""
    return e.function is None or e.function.__module__ == module.__name__
