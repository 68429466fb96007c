"""JSON files that users write, and their form: scenarios, campaigns, maps, criteria, ..."""

import json
from collections.abc import Iterable
from pathlib import Path
from typing import Any, TypeVar

from pydantic import BaseModel, ConfigDict, ValidationError

from cybership.message_text import counted
from cybership.model_fault import Special, faulty_places, first_fault, no_special
from cybership.renamed import with_new_names

from ..errors import InputError, most_alike, nearest, unique_keys

Model = TypeVar("Model", bound=BaseModel)


class StrictModel(BaseModel):
    """Refuses unknown keys, NaN and infinity."""

    model_config = ConfigDict(defer_build=True, extra="forbid", allow_inf_nan=False)


def json_content(path: Path, what: str, known: Iterable[str] = (), raw: bytes | None = None) -> Any:
    """The content of a JSON file.

    Args:
        path: of the file; UTF-8, perhaps with a byte order mark.
        what: of what it is, for messages: "a map".
        known: names that may be meant beside those of the files there.
        raw: its bytes, where they have been read.

    Raises:
        InputError: it cannot be read, or has a key twice.
    """
    try:
        text = (path.read_bytes() if raw is None else raw).decode("utf-8-sig")
        content = json.loads(text, object_pairs_hook=unique_keys)
        json.dumps(content, ensure_ascii=False).encode()
    except FileNotFoundError:
        files = path.parent.glob("*.json") if path.parent.is_dir() else []
        near, shipped = [p.name for p in files if not p.name.startswith(".")], [*known]
        by_name = most_alike(path.stem, shipped) or not near
        hint = nearest(path.stem, shipped) if by_name else nearest(path.name, near)
        raise InputError(f"no such {what.removeprefix('a ')}: '{path}'{hint}") from None
    except InputError as error:
        raise InputError(f"'{path}': {error}") from None
    except IsADirectoryError:
        raise InputError(f"'{path}' is a folder; {what} is a file") from None
    except json.JSONDecodeError as error:
        if not error.doc.strip():
            raise InputError(f"'{path}' cannot be read as {what}: it is empty") from None
        raise InputError(f"'{path}' cannot be read as {what}: it is not JSON: {error}") from None
    except RecursionError:
        raise InputError(f"'{path}' cannot be read: it is nested too deeply") from None
    except (OSError, ValueError) as error:
        raise InputError(f"'{path}' cannot be read as {what}: {error}") from None
    return content


def checked(
    model: type[Model], content: Any, where: str, special: Special = no_special, strict: bool = True
) -> Model:
    """Content as its model.

    Args:
        model: the form of the content.
        content: as parsed from JSON.
        where: what messages begin with.
        special: see :func:`cybership.model_fault.first_fault`.
        strict: whether "0.01" is no number, and true no 1.

    Raises:
        InputError: it has another form; names the place, and the nearest right key.
    """
    try:
        return model.model_validate_json(json.dumps(content), strict=strict or None)
    except ValidationError as error:
        others = faulty_places(error, model) - 1
        more = f" (and {counted(others, 'more error')})" if others else ""
        raise InputError(f"{where}: {first_fault(error, model, special)}{more}") from None
    except (TypeError, ValueError, RecursionError) as error:
        raise InputError(f"{where} cannot be written as JSON: {error}") from None


def read_model(
    path: Path,
    model: type[Model],
    what: str,
    special: Special = no_special,
    strict: bool = True,
    renamed: str = "",
    raw: bytes | None = None,
) -> Model:
    """A user's JSON file as its model; see :func:`json_content` and :func:`checked`.

    Args:
        path, model, what, special, strict, raw: see there.
        renamed: kind of file whose old keys are read (:mod:`cybership.renamed`); empty: none are.

    Raises:
        InputError: it cannot be read, or has another form.
    """
    content = json_content(path, what, raw=raw)
    try:
        content = with_new_names(content, renamed, path) if renamed else content
    except ValueError as error:
        raise InputError(f"'{path}' cannot be read as {what}: {error}") from None
    return checked(model, content, f"'{path}'", special, strict)
