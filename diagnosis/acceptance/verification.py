"""Check a validation record: ``python -m diagnosis.verify validation.json``."""

from pathlib import Path
from typing import NamedTuple

from pydantic import BaseModel, ValidationError

from cosim import InputError
from cybership.message_text import first_fault

from ..execution.result_folder import sha256
from .record_keys import FORM
from .signature import is_signed


class File(BaseModel):
    """A file that a record names."""

    role: str = "criteria"
    path: str
    sha256: str


class Record(BaseModel):
    """What is checked of a record."""

    form: str
    criteria: File
    files: list[File]
    reports: list[File]
    public_key: str | None


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
    files = [content.criteria, *content.files, *content.reports]
    return [_signature(path, raw, content, key), *(_check(f, path.parent) for f in files)]


def _read(path: Path) -> tuple[bytes, Record]:
    try:
        raw = path.read_bytes()
        content = Record.model_validate_json(raw)
    except OSError as error:
        raise InputError(f"'{path}' cannot be read: {error.strerror or error}") from None
    except ValidationError as error:
        raise InputError(f"'{path}' is no validation record: {first_fault(error)}") from None
    if content.form != FORM:
        raise InputError(f"'{path}' is not of the form '{FORM}' but of '{content.form[:40]}'")
    return raw, content


def _signature(path: Path, raw: bytes, content: Record, key: str | Path | None) -> Check:
    beside, named = path.with_suffix(".sig"), content.public_key
    if not beside.exists():
        if key is None and named is None:
            return Check(None, "signature: none; a change of the record would not show")
        return Check(False, f"signature: '{beside.name}' is missing beside the record")
    if key is not None:
        try:
            public = Path(key).read_bytes()
        except OSError as error:
            raise InputError(f"the key '{key}' cannot be read: {error.strerror or error}") from None
        where, by = f"'{key}'", f"of {key}"
    elif named is not None:
        public, where = named.encode(), "public_key of the record"
        by = "that the record names (whose? --key)"
    else:
        return Check(False, "signature: the record names no key; --key tells one")
    holds = is_signed(raw, beside.read_bytes(), public, where)
    return Check(holds, f"signature: {'' if holds else 'not of this record '}by the key {by}")


def _check(f: File, folder: Path) -> Check:
    told = f"{f.role}: {f.path}"
    places = [folder / f.path, Path(f.path), folder / Path(f.path).name]
    found = [h for h in map(sha256, places) if h]
    if not f.sha256:
        return Check(None, f"{told}: the record has no hash of it")
    if not found:
        return Check(None, f"{told}: not found here")
    same = f.sha256 in found
    return Check(same, f"{told}: {'the same' if same else 'differs'}")
