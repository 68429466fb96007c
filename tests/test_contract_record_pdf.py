"""The PDF of a record: widths of columns, shades of verdicts, feet of pages, and figures with their numbers."""

from types import SimpleNamespace

import numpy as np
import pytest

from diagnosis.acceptance.record import pdf
from diagnosis.report.document import Plot, ReportSection, Table
from diagnosis.report.pictures.chart import Chart, Panel

pytest.importorskip("reportlab")


@pytest.fixture(scope="module")
def styles():
    return pdf._styles()


def across(text):
    from reportlab.pdfbase.pdfmetrics import stringWidth

    return stringWidth(text, pdf.BOLD, pdf.SIZE - 1.0) + pdf.SIZE


def test_columns_fill_the_page_with_room_for_their_words_and_texts(styles):
    rows = [["a", "two words", "a longer text of some words"], ["bb", "", "x"]]
    wide = pdf._widths(rows, 500.0)
    assert sum(wide) == pytest.approx(500.0)
    least = [across("bb"), across("words"), across("longer")]
    wish = [across(t) - a for t, a in zip(("bb", "two words", rows[0][2]), least, strict=True)]
    free = 500.0 - sum(least)
    assert wide == pytest.approx([a + free * w / sum(wish) for a, w in zip(least, wish, strict=True)])


def test_a_word_that_is_too_long_is_broken_and_a_page_that_is_narrow_is_shared(styles):
    rows = [["x" * 400, "y"]]
    first, second = pdf._widths(rows, 200.0)
    assert first + second == pytest.approx(200.0)
    assert second >= across("y")
    narrow = pdf._widths([["word", "word"]], 10.0)
    assert narrow == pytest.approx([5.0, 5.0])
    assert pdf._widths([["", ""]], 100.0) == pytest.approx([pdf.SIZE, pdf.SIZE]), "nothing wants more"


def cells_of(table):
    return [[cell.style.name for cell in row] for row in table._cellvalues]


def test_verdicts_are_shaded_and_heads_are_bold(styles):
    rows = [("c", "met, with a warning"), ("d", "not met"), ("e", "metres"), ("f", "cannot be judged")]
    made = pdf._table(Table(("criterion", "verdict"), rows, words=True), styles, 300.0)
    names = cells_of(made)
    assert names[0] == ["bold", "bold"]
    assert [row[0] for row in names[1:]] == ["cell"] * 4
    assert [row[1] for row in names[1:]] == ["bold", "bold", "cell", "bold"]
    shades = [(c[1], c[3].hexval()) for c in made._bkgrndcmds]
    assert shades == [((1, 1), "0xdcefdc"), ((1, 2), "0xf3d9d6"), ((1, 4), "0xececec")]
    assert made.repeatRows == 1
    without = pdf._table(Table(("", ""), [("name", "value")], words=True), styles, 300.0)
    assert cells_of(without) == [["bold", "cell"]]
    assert without.repeatRows == 0


def test_a_section_has_its_texts_and_its_tables_that_have_rows(styles):
    part = ReportSection("Head <1>", ["a & b"], [Table(("x",), []), Table(("x",), [("1",)])])
    found = [*pdf._section(part, styles, 300.0)]
    kinds = [type(f).__name__ for f in found]
    assert kinds == ["Paragraph", "Paragraph", "LongTable", "Spacer"]
    assert (found[0].text, found[1].text) == ("Head &lt;1&gt;", "a &amp; b")


def test_the_foot_has_the_number_of_the_page():
    said = []
    canvas = SimpleNamespace(
        setFont=lambda *of: said.append(of),
        drawString=lambda *of: said.append(of),
        drawRightString=lambda *of: said.append(of),
    )
    document = SimpleNamespace(page=2, leftMargin=72.0, width=400.0, bottomMargin=60.0)
    pdf._foot("title", 5, canvas, document)
    assert said == [(pdf.FONT, 7.0), (72.0, 30.0, "title"), (472.0, 30.0, "page 2 of 5")]


def test_figures_stand_behind_the_sections_with_their_numbers(styles, monkeypatch):
    made = []
    monkeypatch.setattr(
        pdf, "_figure", lambda picture, caption, styles, width: made.append((picture, caption)) or "f"
    )
    plots = [(Plot(None, "a < b"), b"1"), (Plot(None, "c"), b"2")]
    story = pdf._story("T & t", {"k": "v"}, [ReportSection("S")], plots, 300.0)
    kinds = [type(s).__name__ for s in story]
    assert kinds == ["Paragraph", "LongTable", "Paragraph", "PageBreak", "Paragraph", "str", "str"]
    assert story[0].text == "T &amp; t"
    assert made == [(b"1", "Figure 1. a &lt; b"), (b"2", "Figure 2. c")]
    assert len(pdf._story("T", {"k": "v"}, [ReportSection("S")], [], 300.0)) == 3


def test_a_document_knows_its_number_of_pages(tmp_path):
    chart = Chart(100.0, [Panel()])
    chart.panels[0].draw(np.arange(2.0), np.arange(2.0), "#000000")
    parts = [ReportSection("Verdict", ["word " * 40] * 26)]
    pdf.write_pdf(tmp_path / "a.pdf", "Title", {"document": "7"}, parts, [Plot(chart, "A chart.")])
    pypdf = pytest.importorskip("pypdf")
    pages = pypdf.PdfReader(tmp_path / "a.pdf").pages
    assert len(pages) == 3
    for k, page in enumerate(pages, 1):
        text = page.extract_text()
        assert f"page {k} of {len(pages)}" in text
        assert "Title · document 7" in text
    assert "Figure 1. A chart." in pages[-1].extract_text()
    assert pages[0].mediabox.width == pytest.approx(595.3, abs=0.1)
    (picture,) = pages[-1].images
    across_, high = picture.image.size
    assert across_ / high == pytest.approx(
        chart.figure().get_size_inches()[0] / chart.figure().get_size_inches()[1], rel=0.02
    )


def test_an_area_is_interrupted_where_one_of_its_lines_is():
    panel, nan = Panel(), np.nan
    panel.fill([0, 1, 2, 3, 4, 5], [0, 1, 2, 3, 4, nan], [5, 6, nan, 8, 9, 10], "red", "band")
    (mark,) = panel.marks
    np.testing.assert_array_equal(mark.x, [0, 1, 1, 0, nan, 3, 4, 4, 3, nan])
    np.testing.assert_array_equal(mark.y, [0, 1, 6, 5, nan, 3, 4, 9, 8, nan])
    assert (mark.area, mark.faint, mark.label) == (True, True, "band")


def test_a_section_has_its_tables_but_for_empty_ones(styles):
    from reportlab.platypus import LongTable

    tables = [Table(("a",), [["1"]]), Table(("b",), []), Table(("c",), [["2"], ["3"]])]
    flow = [*pdf._section(ReportSection("head", ["text"], tables), styles, 400.0)]
    found = [cells for part in flow if isinstance(part, LongTable) for cells in [part._cellvalues]]
    assert [len(cells) for cells in found] == [2, 3]
