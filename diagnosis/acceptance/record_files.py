"""The files of a record: the report as HTML and PDF, the record, its signature."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from ..execution.result_folder import sha256
from ..report.content import Content
from ..report.document import Document, Plot, write_document
from ..report.formatting import as_json
from .error_figure import error_figure
from .judged_criterion import Judgement
from .pdf import write_pdf
from .sections import sections
from .signature import public_key, sign

RECORD, PAGE, PDF, SIGNATURE = (f"validation.{kind}" for kind in ("json", "html", "pdf", "sig"))
FILES = (RECORD, PAGE, PDF, SIGNATURE)
TITLE = "Validation record"


def entry(role: str, path: Path) -> dict[str, str]:
    """A file: what it was for, its path as it was given, its SHA-256 (of a log's folder: of the log)."""
    return {"role": role, "path": str(path), "sha256": sha256(path)}


def write_record(
    content: Content, judgements: Sequence[Judgement], folder: Path, key: str | Path | None
) -> list[str]:
    """Write all files into a folder that is there; returns their names.

    The record has the hashes of the report and the public key, so it is written, and signed, last.

    Raises:
        InputError: no such key.
    """
    if key is not None:
        content = Content(content | {"public_key": public_key(key)})
    parts = [*sections(content)]
    figures = [(error_figure(j), j) for j in judgements if j.errors.size]
    plots = [
        Plot(f, f"{j.criterion.title}: error of each window, and the tolerance.") for f, j in figures
    ]
    write_pdf(folder / PDF, TITLE, parts, [f.figure() for f, _ in figures])
    write_document(folder / PAGE, Document(TITLE, sections=[replace(parts[0], plots=plots), *parts[1:]]))
    reports = [entry("report", folder / name) | {"path": name} for name in FILES[1:3]]
    text = as_json(content | {"reports": reports}) + "\n"
    (folder / RECORD).write_bytes(text.encode())
    if key is None:
        return [*FILES[:3]]
    (folder / SIGNATURE).write_bytes(sign(text.encode(), key))
    return [*FILES]
