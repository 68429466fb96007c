"""The files of a record: the report as HTML and PDF, the record, its signature."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

from ...report.content import Content
from ...report.document import Document, Plot, write_document
from ...report.formatting import as_json
from . import FILES, PAGE, PDF, RECORD, SIGNATURE
from .pdf import write_pdf
from .provenance import entry
from .sections import sections
from .signature import public_key, sign

TITLE = "Validation record"


def write_record(
    content: Content, figures: Sequence[Plot], folder: Path, key: str | Path | None
) -> list[str]:
    """Write all files into a folder that is there; returns their names.

    The record has the hashes of the report and the public key, so it is written, and signed, last.

    Raises:
        InputError: no such key.
    """
    if key is not None:
        content = Content(content | {"public_key": public_key(key)})
    parts = [*sections(content)]
    write_pdf(folder / PDF, TITLE, _head(content), parts, figures)
    shown = [replace(parts[0], plots=figures), *parts[1:]]
    write_document(folder / PAGE, Document(TITLE, sections=shown))
    reports = [entry("report", folder / name) | {"path": name} for name in FILES[1:3]]
    text = as_json(content | {"reports": reports}) + "\n"
    (folder / RECORD).write_bytes(text.encode())
    if key is None:
        return [*FILES[:3]]
    (folder / SIGNATURE).write_bytes(sign(text.encode(), key))
    return [*FILES]


def _head(r: Content) -> Mapping[str, str]:
    """What stands on page one of the PDF above the verdict."""
    stated = r.particulars
    return {
        "document": stated.document,
        "client": stated.client,
        "assessor": stated.assessor,
        "model": f"{r.model} ({stated.model}, version {stated['model version']})",
        "ship": f"{r.ship} ({stated.ship})",
        "made": f"{r.made}, by cybership {r.code.version}",
        "runs": ", ".join(s.run for s in r.samples),
    }
