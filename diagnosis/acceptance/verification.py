"""Check a validation record: ``python -m diagnosis.verify validation.json``."""

from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

from pydantic import TypeAdapter, ValidationError

from cosim import InputError
from fmus.message_text import first_fault

from ..execution.result_folder import sha256
from .record_keys import FORM, FileResult, RecordContent
from .signature import is_signed

SUFFIX = ".sig"


class Check(NamedTuple):
    """One thing that was checked: whether it holds (None: cannot be checked here), in a line."""

    holds: bool | None
    line: str


def verify_record(record: str | Path, key: str | Path | None = None) -> list[Check]:
    """Check the signature of a record, and the hashes of all files that it names, where they are found.

    A file is looked for as it was given, from here and from the record's folder, and beside the record.

    Args:
        record: ``validation.json``; its signature lies beside it.
        key: file of the public key (PEM) that must have signed; None: the one that the record names.

    Raises:
        InputError: it is no record, or no key.
    """
    path = Path(record)
    raw, content = _read(path)
    files = [
        FileResult(role="criteria", path=content.criteria.path, sha256=content.criteria.sha256),
        *content.files,
        *content.reports,
    ]
    return [*_signature(path, raw, content, key), *(_check(f, path.parent) for f in files)]


def _read(path: Path) -> tuple[bytes, RecordContent]:
    try:
        raw = path.read_bytes()
        content = TypeAdapter(RecordContent).validate_json(raw)
    except OSError as error:
        raise InputError(f"'{path}' cannot be read: {error.strerror or error}") from None
    except ValidationError as error:
        raise InputError(f"'{path}' is no validation record: {first_fault(error)}") from None
    if content.form != FORM:
        raise InputError(f"'{path}' is not of the form '{FORM}' but of '{content.form[:40]}'")
    return raw, content


def _signature(
    path: Path, raw: bytes, content: RecordContent, key: str | Path | None
) -> Iterator[Check]:
    beside = path.with_suffix(SUFFIX)
    named = content.public_key
    if key is None and named is None and not beside.exists():
        yield Check(None, "signature: none; a change of the record would not show")
        return
    if not beside.exists():
        yield Check(False, f"signature: '{beside.name}' is missing beside the record")
        return
    if key is not None:
        try:
            public: str | bytes = Path(key).read_bytes()
        except OSError as error:
            raise InputError(f"the key '{key}' cannot be read: {error.strerror or error}") from None
        where, by = f"'{key}'", f"of {key}"
    else:
        public, where, by = (
            named or "",
            "public_key of the record",
            "that the record names (whose? --key)",
        )
        if named is None:
            yield Check(False, "signature: the record names no key; --key tells one")
            return
    if is_signed(raw, beside.read_bytes(), public, where):
        yield Check(True, f"signature: by the key {by}")
    else:
        yield Check(False, f"signature: not of this record by the key {by}")


def _check(f: FileResult, folder: Path) -> Check:
    told = f"{f.role}: {f.path}"
    places = [folder / f.path, Path(f.path), folder / Path(f.path).name]
    found = [h for h in map(sha256, places) if h]
    if not f.sha256:
        return Check(None, f"{told}: the record has no hash of it")
    if not found:
        return Check(None, f"{told}: not found here")
    if f.sha256 in found:
        return Check(True, f"{told}: the same")
    return Check(False, f"{told}: differs")
