"""Progress: the line on the terminal states the step and the elapsed time."""

from io import StringIO

from rich.console import Console

from diagnosis.execution.progress import progress


def test_the_line_is_away_while_an_answer_is_printed():
    text = StringIO()
    with progress(Console(file=text, force_terminal=True, width=100)) as line:
        line("every effect as a candidate")
        with line.paused():
            shown = len(text.getvalue())
            text.write("the answer")
        line("effect 2: the best candidates refined")
    assert text.getvalue()[shown:].startswith("the answer")
    assert "effect 2" in text.getvalue()


def test_the_elapsed_time_is_seen_next_to_a_long_name():
    screen = StringIO()
    console = Console(file=screen, force_terminal=True, width=60, color_system=None)
    with progress(console) as advance:
        advance(f"smoothing {'zigzag_31-Jul-2020_13_04_24, ' * 4}")
        advance._bar.refresh()
    assert "0:00:00 smoothing" in screen.getvalue()
