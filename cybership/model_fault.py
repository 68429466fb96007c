"""The first fault of a file that a model of pydantic describes: where, what, and what may be meant."""

from collections.abc import Callable, Iterator, Mapping
from types import UnionType
from typing import Annotated, Union, get_args, get_origin

from pydantic import BaseModel, ValidationError

from .message_text import Location, brief, name_of, nearest, quoted

# Of faults that come before others: of what a number may stand in place of, the number.
TYPES = {"extra_forbidden": 0, "finite_number": 1, "float_type": 2}
Special = Callable[[str, Location, object], str]


def no_special(*_: object) -> str:
    """Nothing special is said of a fault."""
    return ""


def first_fault(error: ValidationError, form: object, special: Special = no_special) -> str:
    """The first fault of a file in one line.

    A key that is not known comes before the one that it leaves missing, and a number, or one that is not
    finite, before what else could stand in its place.

    Args:
        error: of the content.
        form: the model of the content, or another type; tells which keys there are in each place.
        special: what is said of a fault by its type, place and value; empty: what pydantic says.
    """
    fault = min(error.errors(), key=lambda each: TYPES.get(each["type"], len(TYPES)))
    kind, at, text, value = fault["type"], fault["loc"], fault["msg"], fault["input"]
    place, known = _place(at[:-1] if kind == "extra_forbidden" else at, form)
    if kind == "extra_forbidden":
        place.append(at[-1])
    if own := special(kind, at, value):
        text = own
    elif kind == "extra_forbidden":
        text = f"unknown key{nearest(str(at[-1]), known)}"
    elif kind == "missing":
        text = "is missing"
    elif at and text.startswith("Input") and isinstance(value, int | float | str):
        text += f"; got {quoted(value)}"
    where = "".join(f"[{part}]" if isinstance(part, int) else f".{name_of(part)}" for part in place)
    where = where.removeprefix(".") or ("the content" if not at and text.startswith("Input") else "")
    return (f"{where}: " if where else "") + brief(text.removeprefix("Value error, "))


def faulty_places(error: ValidationError, form: object) -> int:
    """Number of places with a fault; one that fits none of several types is one place."""
    return len({tuple(_place(fault["loc"], form)[0]) for fault in error.errors()})


def _place(at: Location, form: object) -> tuple[list[int | str], list[str]]:
    """The parts of a place that are of the file, not names of types; and the keys that it may have."""
    place: list[int | str] = []
    here = list(_members(form))
    for part in at:
        # Of a union of models pydantic names the one that was meant.
        meant = [m for m in here if _is_kind(m, part)] if len(here) > 1 else []
        inner = [] if meant else [m for each in here for m in _inside(each, part)]
        here = meant or inner or here
        if inner:
            place.append(part)
    return place, [key for each in here for key in _keys(each)]


def _members(form: object) -> Iterator[object]:
    """The types of a union; a type that is none alone."""
    if get_origin(form) is Annotated:
        yield from _members(get_args(form)[0])
    elif get_origin(form) in (Union, UnionType):
        for member in get_args(form):
            yield from _members(member)
    else:
        yield form


def _keys(form: object) -> Mapping[str, object]:
    """Key -> type of its value."""
    if not (isinstance(form, type) and issubclass(form, BaseModel)):
        return {}
    return {field.alias or name: field.annotation for name, field in form.model_fields.items()}


def _is_kind(form: object, part: int | str) -> bool:
    return any(part in get_args(value) for value in _keys(form).values())


def _inside(form: object, part: int | str) -> Iterator[object]:
    """The types that a part of a place leads to."""
    inner, origin, keys = get_args(form), get_origin(form), _keys(form)
    if part in keys:
        inner = (keys[str(part)],)
    elif origin is dict:
        inner = inner[1:] if isinstance(part, str) else ()
    elif not isinstance(part, int) or origin not in (list, tuple):
        inner = ()
    elif origin is tuple and Ellipsis not in inner:
        inner = inner[part : part + 1]
    for each in inner:
        yield from _members(each)
