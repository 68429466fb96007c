"""A document as a PDF in A4: head and verdict on page one, tables, captioned figures, page numbers."""

import re
from collections.abc import Iterator, Mapping, Sequence
from functools import partial
from io import BytesIO
from pathlib import Path
from typing import Any
from xml.sax.saxutils import escape

from cosim import InputError
from cosim.command import missing_extra

from ...report.document import Plot, ReportSection, Table
from ...report.pictures.chart import Chart

FONT, BOLD = "DejaVuSans", "DejaVuSans-Bold"  # those of matplotlib, which have Greek
SIZE = 8.0  # pt, of letters, and of the margins of a cell together; chosen
HIGHEST = 310.0  # pt, of a figure: two to a page of A4; chosen
SHADES = {
    "met": "#dcefdc",
    "not met": "#f3d9d6",
    "cannot be judged": "#ececec",
}  # by a verdict's beginning


def write_pdf(
    path: Path,
    title: str,
    head: Mapping[str, str],
    parts: Sequence[ReportSection],
    figures: Sequence[Plot],
) -> None:
    """Write the document.

    Args:
        path: of the file.
        title: of the document.
        head: what stands on page one above all else; the first entry also in the foot of each page.
        parts: sections; the first is the verdict.
        figures: behind the sections that judge.

    Raises:
        InputError: the library is not installed.
    """
    try:
        from reportlab.lib.pagesizes import A4
        from reportlab.platypus import SimpleDocTemplate
    except ModuleNotFoundError as error:
        raise InputError(missing_extra(error)) from None
    pictures, pages = [_png(plot) for plot in figures], 0
    while True:  # the second time the number of pages is known
        out, foot = BytesIO(), partial(_foot, f"{title} · {' '.join(next(iter(head.items())))}", pages)
        made = SimpleDocTemplate(out, pagesize=A4, title=title, invariant=1)
        story = _story(title, head, parts, [*zip(figures, pictures, strict=True)], made.width)
        made.build(story, onFirstPage=foot, onLaterPages=foot)
        if pages == made.page:
            break
        pages = made.page
    path.write_bytes(out.getvalue())


def _story(
    title: str,
    head: Mapping[str, str],
    parts: Sequence[ReportSection],
    figures: Sequence[tuple[Plot, bytes]],
    width: float,
) -> list[Any]:
    from reportlab.platypus import PageBreak, Paragraph

    styles = _styles()
    story: list[Any] = [Paragraph(escape(title), styles["title"])]
    story.append(_table(Table(("", ""), [*head.items()], words=True), styles, width))
    for part in parts:
        story += _section(part, styles, width)
    if figures:
        story += [PageBreak(), Paragraph("Figures", styles["heading"])]
    for number, (plot, picture) in enumerate(figures, 1):
        story.append(_figure(picture, f"Figure {number}. {escape(plot.caption)}", styles, width))
    return story


def _foot(text: str, pages: int, canvas: Any, document: Any) -> None:
    """What stands at the foot of each page."""
    canvas.setFont(FONT, SIZE - 1.0)
    canvas.drawString(document.leftMargin, document.bottomMargin / 2.0, text)
    last = f"page {document.page} of {pages}"
    right = document.leftMargin + document.width
    canvas.drawRightString(right, document.bottomMargin / 2.0, last)


def _styles() -> dict[str, Any]:
    import matplotlib
    from reportlab.lib.styles import ParagraphStyle
    from reportlab.pdfbase.pdfmetrics import registerFont
    from reportlab.pdfbase.ttfonts import TTFont

    folder = Path(matplotlib.get_data_path(), "fonts", "ttf")
    for name in (FONT, BOLD):
        registerFont(TTFont(name, str(folder / f"{name}.ttf")))
    text = ParagraphStyle("text", fontName=FONT, fontSize=SIZE, leading=1.4 * SIZE, spaceAfter=SIZE / 2)
    cell = ParagraphStyle(
        "cell", text, spaceAfter=0.0, fontSize=SIZE - 1.0, leading=1.3 * SIZE, splitLongWords=True
    )
    bold = ParagraphStyle("bold", cell, fontName=BOLD)
    heading = ParagraphStyle(
        "heading",
        text,
        fontName=BOLD,
        fontSize=SIZE + 3.0,
        leading=2.0 * SIZE,
        spaceBefore=1.5 * SIZE,
        keepWithNext=1,
    )
    title = ParagraphStyle("title", heading, fontSize=2.0 * SIZE, leading=3.0 * SIZE)
    return {"text": text, "cell": cell, "bold": bold, "heading": heading, "title": title}


def _section(part: ReportSection, styles: Mapping[str, Any], width: float) -> Iterator[Any]:
    from reportlab.platypus import Paragraph, Spacer

    yield Paragraph(escape(part.heading), styles["heading"])
    for text in part.text:
        yield Paragraph(escape(text), styles["text"])
    for table in part.tables:
        if table.rows:
            yield _table(table, styles, width)
            yield Spacer(0.0, SIZE)


def _table(table: Table, styles: Mapping[str, Any], width: float) -> Any:
    """A table as wide as the page, its columns by the length of their texts, verdicts shaded."""
    from reportlab.lib.colors import HexColor
    from reportlab.platypus import LongTable, Paragraph, TableStyle

    headed = any(table.header)
    rows = [[str(x) for x in row] for row in ([table.header] if headed else []) + [*table.rows]]
    look: list[Any] = [
        ("LINEBELOW", (0, 0), (-1, -1), 0.3, HexColor("#bbbbbb")),
        ("VALIGN", (0, 0), (-1, -1), "TOP"),
        ("LEFTPADDING", (0, 0), (-1, -1), SIZE / 2.0),
        ("RIGHTPADDING", (0, 0), (-1, -1), SIZE / 2.0),
    ]
    cells = []
    for k, row in enumerate(rows):
        shades = [next((SHADES[v] for v in SHADES if re.match(f"{v}($|,)", text)), None) for text in row]
        bold = [bool(s) or (k == 0 if headed else j == 0) for j, s in enumerate(shades)]
        cells.append(
            [
                Paragraph(escape(x), styles["bold" if b else "cell"])
                for x, b in zip(row, bold, strict=True)
            ]
        )
        look += [("BACKGROUND", (j, k), (j, k), HexColor(s)) for j, s in enumerate(shades) if s]
    return LongTable(
        cells, _widths(rows, width), repeatRows=int(headed), style=TableStyle(look), hAlign="LEFT"
    )


def _widths(rows: Sequence[Sequence[str]], width: float) -> list[float]:
    """Of columns that fill a width [pt]: room for the longest words, the rest by the length of texts."""
    from reportlab.pdfbase.pdfmetrics import stringWidth

    def across(text: str) -> float:
        return stringWidth(text, BOLD, SIZE - 1.0) + SIZE

    columns = [*zip(*rows, strict=True)]
    most = 1.5 * width / len(columns)  # a word that is longer, such as a hash, is broken
    words = [max(min(across(w), most) for text in c for w in text.split() or [""]) for c in columns]
    least = [w * min(1.0, width / sum(words)) for w in words]
    wish = [max(map(across, c)) - least_ for c, least_ in zip(columns, least, strict=True)]
    free, wishes = max(width - sum(least), 0.0), sum(wish) or 1.0
    return [a + free * b / wishes for a, b in zip(least, wish, strict=True)]


def _png(plot: Plot) -> bytes:
    assert isinstance(plot.figure, Chart)
    figure, picture = plot.figure.figure(), BytesIO()
    figure.set_facecolor("white")
    figure.savefig(picture, dpi=200, format="png")
    return picture.getvalue()


def _figure(picture: bytes, caption: str, styles: Mapping[str, Any], width: float) -> Any:
    """A figure with its caption, on one page."""
    from reportlab.platypus import Image, KeepTogether, Paragraph, Spacer

    image = Image(BytesIO(picture), width, HIGHEST, kind="proportional")
    return KeepTogether([image, Paragraph(caption, styles["text"]), Spacer(0.0, SIZE)])
