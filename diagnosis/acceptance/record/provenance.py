"""All that decides a record: files with their hashes, samples, parameters, the code."""

import subprocess
import sys
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from functools import cache
from hashlib import sha256
from importlib.metadata import PackageNotFoundError, distribution, version
from inspect import getsourcefile
from pathlib import Path
from typing import Any

from cosim import InputError

from ...execution.result_folder import sha256 as sha256_of
from ...predictors import Model, Predictor, read_model
from ...predictors.evaluation import Evaluation
from ...report.content import COUNTS, part
from ...runs import samples_sha256
from ...session import Comparison

PROJECT = Path(__file__).parents[3]
PACKAGES = ("fmus", "fmucheck", "cosim", "diagnosis", "cybership")
LIBRARIES = ("numpy", "scipy", "pandas", "fmpy", "pydantic", "pythonfmu", "cryptography", "matplotlib")
SOURCES = (".py", ".c")  # of a clone and of a wheel alike; ships are hashed by their numbers
Files = Mapping[str, "Path | str | Sequence[Path | str] | None"]


def entry(role: str, path: Path, expected: str = "") -> dict[str, str]:
    """A file: what it was for, its path as it was given, its SHA-256 (of a log's folder: of the log).

    Args:
        role: what it was for.
        path: of the file.
        expected: hash that it had when it was read; empty: not known.

    Raises:
        InputError: it cannot be read, or has changed since.
    """
    found = sha256_of(path)
    if not found:
        raise InputError(f"'{path}' cannot be read again: the record needs its hash")
    if expected and found != expected:
        raise InputError(f"'{path}' has changed since the comparison: repeat the comparison")
    return {"role": role, "path": str(path), "sha256": found}


def files_of(comparison: Comparison, further: Files) -> list[dict[str, str]]:
    """All files that decide a comparison, each once.

    Args:
        comparison: of the model with the runs.
        further: other files by what they are for; those that the comparison knows go before.

    Raises:
        InputError: one cannot be read, has changed, or is not the one that was compared.
    """
    data = [
        entry("data" if path == run.file else "layout of data", path, known)
        for run in (e.weak_windows.run for e in comparison.evaluations)
        for path, known in run.hashes.items()
    ]
    found = [*data, *_model(comparison)]
    known = {role: f["sha256"] for f in reversed(found) for role in [f["role"]]}
    paths = {Path(f["path"]).resolve() for f in found}
    for role, given in further.items():
        several = [] if given is None else [given] if isinstance(given, (str, Path)) else given
        for path in map(Path, several):
            if not path.exists() and role in ("effects", "ship"):
                continue  # the name of one that is installed, which the code is hashed with
            each = entry(role, path)
            if role == "model" and known.get(role) != each["sha256"] and not _is_read(comparison, path):
                raise InputError(f"'{path}' is not the model that was compared")
            if path.resolve() not in paths:
                found.append(each)
                paths.add(path.resolve())
    return found


def _model(comparison: Comparison) -> Iterator[dict[str, str]]:
    """The files of model, effects and ship, with modules of Python that lie with them."""
    predictor = comparison.predictor
    model = comparison.evaluations[0].model
    files = [(role, Path(path), known) for role, path, known in getattr(predictor, "files", ())]
    if foreign(predictor):
        with suppress(TypeError, OSError):  # a class without a file, as of a notebook
            files.append(("model", Path(getsourcefile(type(predictor)) or ""), ""))
    files += [("effects", Path(path), "") for path in model.ship.effects.files]
    folders = {path.resolve().parent for _, path, _ in files if path.suffix == ".py"}
    for module in [*sys.modules.values()]:
        path = Path(getattr(module, "__file__", None) or "")
        if path.suffix == ".py" and path.parent.resolve() in folders and not _ours(path):
            files.append(("module", path, ""))
    seen: set[Path] = set()
    for role, path, known in files:
        if path.is_file() and path.resolve() not in seen:
            seen.add(path.resolve())
            yield entry(role, path, known)


def foreign(predictor: Predictor) -> bool:
    """Whether a predictor is a class that this project does not have."""
    file = getattr(sys.modules.get(type(predictor).__module__), "__file__", None)
    return file is None or not _ours(Path(file))


def _is_read(comparison: Comparison, path: Path) -> bool:
    """Whether a parameter set is the model, which was read from it before."""
    model = comparison.predictor.model
    if not comparison.predictor.parametric or path.suffix != ".ssv":
        return False
    return parameters_of(read_model(path, model.ship)) == parameters_of(model)


def parameters_of(model: Model) -> list[Any]:
    """The parameters of a model."""
    parts = (*model.ship.parameters, "measurement")
    runs = sorted((run, sorted(values.items())) for run, values in model.runs.items())
    return [*(sorted(getattr(model, part).items()) for part in dict.fromkeys(parts)), runs]


def _ours(path: Path) -> bool:
    return any((PROJECT / name) in path.resolve().parents for name in PACKAGES)


def samples(evaluations: Sequence[Evaluation]) -> list[dict[str, Any]]:
    """Of each run the hash of its samples as they were used, and their counts; a table has no file."""
    return [
        {"run": e.name, "file": str(e.weak_windows.run.file or ""), "sha256": samples_sha256(e.smoothed)}
        | part(e.smoothed.counts, COUNTS)
        | {"notes": [*e.smoothed.notes]}
        for e in evaluations
    ]


def parameters_sha256(comparison: Comparison) -> dict[str, str]:
    """Hashes of the numbers of the ship's description, and of the model's parameters."""
    e = comparison.evaluations[0]
    model = e.learned or e.model
    return {"ship": _hash(model.ship.description), "parameters": _hash(parameters_of(model))}


def _hash(value: Any) -> str:
    return sha256(repr(value).encode()).hexdigest()


@cache
def code() -> dict[str, Any]:
    """The code that made a record: hash of all sources, version, revision of git, libraries."""
    total = sha256()
    for name in PACKAGES:
        for path in sorted((PROJECT / name).rglob("*")):
            if path.suffix in SOURCES:
                total.update(path.relative_to(PROJECT).as_posix().encode() + b"\0" + path.read_bytes())
    return {
        "version": version("cybership"),
        "sha256": total.hexdigest(),
        "revision": _revision(),
        "libraries": {name: known for name in LIBRARIES if (known := _version(name))},
    }


def _version(name: str) -> str | None:
    try:
        return distribution(name).version
    except PackageNotFoundError:
        return None


def _revision() -> str | None:
    """Of the clone that the code lies in, and whether that is changed; None where there is none."""
    if not (PROJECT / ".git").exists():
        return None
    git = ("git", "-C", str(PROJECT))
    try:
        head, changed = (
            subprocess.run(
                (*git, *rest), capture_output=True, text=True, timeout=10.0, check=True
            ).stdout
            for rest in (("rev-parse", "HEAD"), ("status", "--porcelain", "--untracked-files=no"))
        )
    except (OSError, subprocess.SubprocessError):
        return None
    return head.strip() + (", with changes" if changed.strip() else "")
