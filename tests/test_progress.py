"""Progress: the remaining time of a search is told once it has begun, and falls while a step goes on."""

import re
from io import StringIO

import pytest
from rich.console import Console

from diagnosis.execution.progress import progress, remaining
from diagnosis.execution.remaining_time import FIRST, REJECTED, USUAL, RemainingTime

ROUND = ("every effect as a candidate", "the best candidates refined")
BEFORE = ["reading", "smoothing a", "predicting a", "calibration of the coefficients", ROUND[0]]
AFTER = [
    "waves",
    "effects without which validation data are predicted better",
    "fit to predictions",
    "residual",
    "gain of the search over calibration",
    "predicting a",
    "stability",
    "report: figures",
    "report: page",
]


def search(effects: int, likely: int) -> list[tuple[str, float]]:
    """The steps of a search that finds so many effects of those likely, and what each takes [s]."""
    steps = []
    for k in range(1, effects + 2):
        about = f", about {likely} likely" if k > 1 else ""
        steps += [f"effect {k}: {ROUND[0]}", f"effect {k}{about}: {ROUND[1]}"][k == 1 :]
        if k <= effects:
            steps += [f"effect {j}: its place searched again" for j in range(1, k)]
    steps = [*BEFORE, *steps, *(AFTER if effects else (w for w in AFTER if "predictions" not in w))]
    took = [next((usual for name, usual in USUAL.items() if name in what), 1.0) for what in steps]
    took[len(BEFORE) - 1] *= FIRST
    took[max(k for k, what in enumerate(steps) if ROUND[1] in what)] *= REJECTED
    many = [effects if "validation data" in what else 1.0 for what in steps]
    return [(what, t * n) for what, t, n in zip(steps, took, many, strict=True)]


SEARCH = [what for what, _ in search(2, 2)]


class Clock:
    def __init__(self):
        self.time = 0.0

    def __call__(self):
        return self.time


@pytest.mark.parametrize("speed", [0.3, 1.0, 3.0])
@pytest.mark.parametrize(("effects", "likely"), [(0, 0), (1, 1), (1, 2), (3, 3), (3, 4), (6, 6)])
def test_remaining_time_is_right_within_a_factor_of_two_on_slow_and_fast_machines(
    effects, likely, speed
):
    """It is stated once an effect is accepted, or none is, at every step from there on."""
    clock, steps = Clock(), search(effects, likely)
    left, whole = RemainingTime(clock), speed * sum(t for _, t in steps)
    for k, (what, took) in enumerate(steps):
        left.begin(what)
        if k < len(BEFORE) + (2 if effects else 1):
            assert left.seconds is None
            assert left.share is None
        elif whole - clock.time > 0.05 * whole:
            assert 0.5 * (whole - clock.time) < left.seconds < 2.0 * (whole - clock.time), what
        clock.time += speed * took


def test_more_likely_effects_take_longer_and_the_time_is_told_in_words():
    def begun(likely):
        left = RemainingTime(Clock())
        left.begin(f"effect 2, about {likely} likely: {ROUND[1]}")
        return left

    few, some, many = (begun(likely).seconds for likely in (0, 3, 6))
    assert few < some < many
    assert re.fullmatch(r", about \d+ s more", remaining(begun(6)))
    slow = begun(6)
    slow._now.time += 1000.0
    assert re.fullmatch(r", about \d+ min more", remaining(slow))
    assert remaining(RemainingTime(Clock())) == ""


# Steps of `learn` from a log of R/V Gunnerus and processor times [s]; six effects were accepted in turn
# (AMD EPYC, seed 0).
RECORDED = [
    ("reading", 0.0),
    ("smoothing a", 6.6),
    ("predicting a", 0.1),
    ("calibration of the coefficients", 2.3),
    ("predicting a", 0.3),
    ("every effect as a candidate", 4.0),
    ("effect 1: the best candidates refined", 7.9),
    ("effect 2: every effect as a candidate", 3.7),
    ("effect 2, about 6 likely: the best candidates refined", 3.5),
    ("effect 1: its place searched again", 4.0),
    ("effect 3: every effect as a candidate", 1.2),
    ("effect 3, about 6 likely: the best candidates refined", 4.6),
    ("effect 1: its place searched again", 4.1),
    ("effect 2: its place searched again", 2.1),
    ("effect 4: every effect as a candidate", 1.3),
    ("effect 4, about 6 likely: the best candidates refined", 2.0),
    ("effect 1: its place searched again", 1.8),
    ("effect 2: its place searched again", 1.8),
    ("effect 3: its place searched again", 5.9),
    ("effect 5: every effect as a candidate", 1.4),
    ("effect 5, about 6 likely: the best candidates refined", 3.5),
    ("effect 1: its place searched again", 1.6),
    ("effect 2: its place searched again", 2.1),
    ("effect 3: its place searched again", 1.6),
    ("effect 4: its place searched again", 3.5),
    ("effect 1: its place searched again", 1.6),
    ("effect 2: its place searched again", 1.7),
    ("effect 3: its place searched again", 1.6),
    ("effect 6: every effect as a candidate", 1.3),
    ("effect 6, about 6 likely: the best candidates refined", 2.5),
    ("effect 1: its place searched again", 1.7),
    ("effect 2: its place searched again", 1.9),
    ("effect 3: its place searched again", 1.7),
    ("effect 4: its place searched again", 5.7),
    ("effect 5: its place searched again", 2.2),
    ("effect 1: its place searched again", 1.7),
    ("effect 2: its place searched again", 1.9),
    ("effect 3: its place searched again", 1.7),
    ("effect 7: every effect as a candidate", 1.5),
    ("waves", 2.2),
    ("effects without which validation data are predicted better", 12.9),
    ("fit to predictions", 7.9),
    ("residual", 1.1),
    ("gain of the search over calibration", 0.8),
    ("predicting a", 0.5),
    ("stability", 0.0),
    ("dissipation", 0.0),
    ("the decay of the motion without thrust", 1.6),
    ("report: figures", 0.3),
    ("report: page", 0.3),
]


def test_of_a_recorded_search_with_six_effects():
    clock, whole = Clock(), sum(took for _, took in RECORDED)
    left, stated = RemainingTime(clock), []
    for what, took in RECORDED:
        left.begin(what)
        rest = whole - clock.time
        if left.seconds is not None and rest > 0.05 * whole:
            assert 0.5 * rest < left.seconds < 2.0 * rest, what
            stated.append(what)
        clock.time += took
    assert stated[0].startswith("effect 2, about 6 likely")


def test_a_part_of_a_step_has_the_time_of_that_step():
    clock = Clock()
    left = RemainingTime(clock)
    for what in (*SEARCH[:8], "stability"):
        left.begin(what)
        clock.time += 1.0
    before = left.seconds
    left.begin("closed loop on the ellipse")
    assert left.seconds == before


def test_the_bar_moves_while_a_step_goes_on():
    clock = Clock()
    left = RemainingTime(clock)
    for what in SEARCH[:8]:
        left.begin(what)
        clock.time += 1.0
    shares = []
    for _ in range(100):
        clock.time += 1.0
        shares.append(left.share)
    assert shares == sorted(shares)
    assert 0.0 < shares[0] < shares[-1] < 1.0


def test_a_step_of_another_command_has_no_remaining_time():
    left = RemainingTime(Clock())
    for what in ("reading", "something of a user's method", "report: figures", "report: page"):
        left.begin(what)
        assert left.seconds is None


def test_the_line_is_away_while_an_answer_is_printed():
    text = StringIO()
    with progress(Console(file=text, force_terminal=True, width=100)) as line:
        line("every effect as a candidate")
        with line.paused():
            shown = len(text.getvalue())
            text.write("the answer")
        line("effect 2, about 6 likely: the best candidates refined")
    assert text.getvalue()[shown:].startswith("the answer")
    assert "more" in text.getvalue()


def test_the_elapsed_time_is_seen_next_to_a_long_name():
    screen = StringIO()
    console = Console(file=screen, force_terminal=True, width=60, color_system=None)
    with progress(console) as advance:
        advance(f"smoothing {'zigzag_31-Jul-2020_13_04_24, ' * 4}")
        advance._bar.refresh()
    assert "0:00:00 smoothing" in screen.getvalue()
