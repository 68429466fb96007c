"""Check a validation record: ``python -m diagnosis.verify validation.json``."""

from collections.abc import Collection
from pathlib import Path
from typing import NamedTuple

from pydantic import BaseModel

from cosim import InputError
from cosim.command import printable
from cosim.scenario import read_model

from ...execution.result_folder import sha256
from .provenance import code
from .signature import is_signed

FORM = "cybership validation record 2"  # of the records of this version
# What compare writes next to a record, so that a file of that name is no copy of one that it read.
OUTPUTS = ("comparison.json", "report.html", "map.json")
UNKNOWN_OWNER = "key: the owner of the key in the record is not known; --key gives the key of the signer"
SIGNATURE, KEY, CODE = "signature", "key", "code"  # names that --allow-missing takes besides files


class HashedFile(BaseModel):
    """A file that a record names."""

    role: str = "criteria"
    path: str
    sha256: str


class RunSamples(BaseModel):
    """The samples of a run, and the file that they are from; empty: none."""

    run: str
    file: str


class CodeHash(BaseModel):
    """The code that made a record."""

    version: str
    sha256: str


class Record(BaseModel):
    """What is checked of a record."""

    form: str
    code: CodeHash
    criteria: HashedFile
    files: list[HashedFile]
    samples: list[RunSamples]
    reports: list[HashedFile]
    public_key: str | None


class Check(NamedTuple):
    """One thing that was checked: whether it holds, in a line.

    Attributes:
        holds: None: it could not be checked.
        line: what was found.
        name: by which it may be missing, see :func:`verify_record`.
        allowed: whether it may.
    """

    holds: bool | None
    line: str
    name: str = ""
    allowed: bool = False


def verify_record(
    record: str | Path, key: str | Path | None = None, allow_missing: Collection[str] = ()
) -> list[Check]:
    """Check the signature of a record, the code, and the hashes of all files that it names.

    A file is looked for as it was given, from here and from the record's folder, and by its name in the
    record's folder. Wherever one is found, it must be the one that the record names.

    Args:
        record: ``validation.json``; its signature is next to it.
        key: file of the public key (PEM) that must have signed; None: the one that the record names, of
            which nobody says whose it is.
        allow_missing: what need not be checked: ``signature``, ``key``, ``code``, and files by their
            name, their path or what they are for.

    Raises:
        InputError: it is not a record, or not a key; or a name in ``allow_missing`` is unknown.
    """
    path = Path(record)
    raw, content = _read(path)
    files = [content.criteria, *content.files, *content.reports]
    checks = [_signature(path, raw, content, key), _code(content)]
    if content.public_key is not None and key is None:
        checks.insert(1, Check(None, UNKNOWN_OWNER, KEY))
    checks += [_check(f, path.parent, files) for f in files]
    tables = [s.run for s in content.samples if not s.file]
    checks += [Check(None, f"data: run {run} was a table in memory", run) for run in tables]
    known = {SIGNATURE, KEY, CODE, *tables, *(n for f in files for n in _names(f))}
    for name in allow_missing:
        if name not in known:
            raise InputError(f"'{name}' cannot be allowed; there are {', '.join(sorted(known))}")
    return [
        c._replace(allowed=c.holds is None and not {*c.name.split("\n")}.isdisjoint(allow_missing))
        for c in checks
    ]


def _read(path: Path) -> tuple[bytes, Record]:
    try:
        raw = path.read_bytes()
    except OSError as error:
        raise InputError(
            f"'{path}' cannot be read: {error.strerror or error}; a record is a file validation.json"
        ) from None
    content = read_model(path, Record, "a validation record", raw=raw)
    if content.form != FORM:
        raise InputError(f"'{path}' has the form '{content.form[:40]}'; '{FORM}' is needed")
    return raw, content


def _signature(path: Path, raw: bytes, content: Record, key: str | Path | None) -> Check:
    beside, named = path.with_suffix(".sig"), content.public_key
    if not beside.exists():
        if key is None and named is None:
            return Check(None, "signature: none; a change of the record is not detectable", SIGNATURE)
        return Check(False, f"signature: '{beside.name}' is missing next to the record")
    if key is not None:
        try:
            public = Path(key).read_bytes()
        except OSError as error:
            raise InputError(f"the key '{key}' cannot be read: {error.strerror or error}") from None
        where, by = f"'{key}'", f"of {key}"
    elif named is not None:
        public, where, by = named.encode(), "public_key of the record", "that the record names"
    else:
        return Check(False, "signature: present, but the record names no key; --key gives one")
    holds = is_signed(raw, beside.read_bytes(), public, where)
    return Check(holds, f"signature: {'' if holds else 'not of this record '}by the key {by}")


def _code(content: Record) -> Check:
    here, there = code(), content.code
    same = there.sha256 == here["sha256"]
    stated = f"code: cybership {there.version}, SHA-256 {there.sha256}"
    return Check(
        True if same else None, f"{stated}: {'the same as' if same else 'different from'} here", CODE
    )


def _names(f: HashedFile) -> list[str]:
    return [f.role, f.path, Path(f.path).name]


def _check(f: HashedFile, folder: Path, files: Collection[HashedFile]) -> Check:
    stated, name = f"{f.role}: {printable(f.path)}", Path(f.path).name
    names, copy = "\n".join(_names(f)), (folder / name).resolve()
    named = {(folder / f.path).resolve(), Path(f.path).resolve()}
    places = named if name in OUTPUTS else {*named, copy}
    if not any(map(Path.exists, places)):  # written in a folder above, and verified elsewhere
        places = {parent / f.path for parent in folder.resolve().parents}
    found = {place: h for place in sorted(places) if (h := sha256(place))}
    # A copy in the record's folder may be of another file of that name, such as the log of another run.
    others = {each.sha256 for each in files if Path(each.path).name == name}
    wrong = [p for p, h in found.items() if h != f.sha256 and (p in named or h not in others)]
    found = {place: h for place, h in found.items() if h == f.sha256}
    if wrong:
        return Check(False, f"{stated}: differs ({', '.join(map(str, wrong))})")
    return Check(
        True if found else None, f"{stated}: {'the same' if found else 'not found here'}", names
    )
