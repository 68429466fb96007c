"""Progress: the remaining time of a search is told once it has begun, and falls while a step goes on."""

from io import StringIO

import pytest
from rich.console import Console

from diagnosis.execution.progress import progress
from diagnosis.execution.remaining_time import USUAL, RemainingTime

ROUND = ("every effect as a candidate", "the best candidates refined")
SEARCH = [
    "reading",
    "smoothing a",
    "predicting a",
    "calibration of the coefficients",
    ROUND[0],
    f"effect 1: {ROUND[1]}",
    f"effect 2: {ROUND[0]}",
    f"effect 2: {ROUND[1]}",
    "effect 1: its place searched again",
    f"effect 3: {ROUND[0]}",
    f"effect 3: {ROUND[1]}",
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


class Clock:
    def __init__(self):
        self.time = 0.0

    def __call__(self):
        return self.time


@pytest.mark.parametrize("speed", [0.1, 1.0, 20.0])
def test_remaining_time_is_right_within_a_factor_of_two_on_any_machine(speed):
    clock = Clock()
    left = RemainingTime(clock)
    took = [speed * next(usual for name, usual in USUAL.items() if name in what) for what in SEARCH]
    for k, what in enumerate(SEARCH):
        left.begin(what)
        rest = sum(took[k:])
        if k < SEARCH.index(ROUND[0]):
            assert left.seconds is None
            assert left.share is None
        else:
            assert 0.5 * rest < left.seconds < 2.0 * rest
        clock.time += took[k]


def search(effects: int) -> list[tuple[str, float]]:
    """The steps of a search that finds so many effects, and what each takes [s]."""
    steps = SEARCH[:4]
    for k in range(1, effects + 2):
        steps = [*steps, f"effect {k}: {ROUND[0]}", f"effect {k}: {ROUND[1]}"]
        if k <= effects:
            steps += [f"effect {j}: its place searched again" for j in range(1, k)]
    steps += SEARCH[SEARCH.index("waves") :]
    took = [next(usual for name, usual in USUAL.items() if name in what) for what in steps]
    many = [effects if "validation data" in what else 1.0 for what in steps]
    return [(what, t * n) for what, t, n in zip(steps, took, many, strict=True)]


@pytest.mark.parametrize("effects", [0, 1, 2, 3])
def test_of_few_effects_it_is_right_from_the_first_round_on(effects):
    clock, steps = Clock(), search(effects)
    left, whole = RemainingTime(clock), sum(t for _, t in steps)
    for what, took in steps:
        left.begin(what)
        if left.seconds is not None:
            assert 0.5 * (whole - clock.time) < left.seconds < 2.0 * (whole - clock.time), what
        clock.time += took


@pytest.mark.parametrize("effects", [1, 2, 3, 6])
def test_in_the_second_half_it_is_right_whatever_is_found(effects):
    clock, steps = Clock(), search(effects)
    left, whole = RemainingTime(clock), sum(t for _, t in steps)
    for what, took in steps:
        left.begin(what)
        rest = whole - clock.time
        if rest < 0.5 * whole:
            assert 0.5 * rest < left.seconds < 2.0 * rest, what
        clock.time += took


# Steps of `learn` from run1 of CyberShip Enterprise 1, a measured run, and processor times [s]; it has
# six effects in turn, which nothing shows beforehand (busy core of an AMD EPYC, seed 0).
RECORDED = [
    ("reading", 0.0),
    ("smoothing a", 4.0),
    ("predicting a", 0.7),
    ("calibration of the coefficients", 2.9),
    ("predicting a", 0.7),
    ("every effect as a candidate", 1.7),
    ("effect 1: the best candidates refined", 2.3),
    ("effect 2: every effect as a candidate", 1.6),
    ("effect 2: the best candidates refined", 1.9),
    ("effect 1: its place searched again", 3.1),
    ("effect 3: every effect as a candidate", 1.3),
    ("effect 3: the best candidates refined", 1.6),
    ("effect 1: its place searched again", 4.0),
    ("effect 2: its place searched again", 4.1),
    ("effect 4: every effect as a candidate", 1.3),
    ("effect 4: the best candidates refined", 3.6),
    ("effect 1: its place searched again", 4.9),
    ("effect 2: its place searched again", 4.2),
    ("effect 3: its place searched again", 4.5),
    ("effect 5: every effect as a candidate", 1.0),
    ("effect 5: the best candidates refined", 3.1),
    ("effect 1: its place searched again", 5.6),
    ("effect 2: its place searched again", 5.4),
    ("effect 3: its place searched again", 5.5),
    ("effect 4: its place searched again", 4.6),
    ("effect 6: every effect as a candidate", 1.2),
    ("effect 6: the best candidates refined", 4.4),
    ("effect 1: its place searched again", 5.1),
    ("effect 2: its place searched again", 5.8),
    ("effect 3: its place searched again", 6.3),
    ("effect 4: its place searched again", 5.4),
    ("effect 5: its place searched again", 4.8),
    ("effect 7: every effect as a candidate", 1.3),
    ("waves", 1.4),
    ("effects without which validation data are predicted better", 10.2),
    ("fit to predictions", 5.2),
    ("residual", 1.2),
    ("gain of the search over calibration", 2.6),
    ("predicting a", 1.0),
    ("stability", 0.0),
    ("dissipation", 0.0),
    ("closed loop on the ellipse and the figure of eight", 2.3),
    ("report: figures", 1.5),
    ("report: page", 0.2),
]


def test_of_a_recorded_search_with_six_effects_the_second_half_is_right():
    clock, whole = Clock(), sum(took for _, took in RECORDED)
    left = RemainingTime(clock)
    for what, took in RECORDED:
        left.begin(what)
        rest = whole - clock.time
        if left.seconds is not None and rest > 1.0:
            assert (0.25 if rest > 0.5 * whole else 0.5) * rest < left.seconds < 2.0 * rest, what
        clock.time += took


def test_a_part_of_a_step_has_the_time_of_that_step():
    clock = Clock()
    left = RemainingTime(clock)
    for what in (*SEARCH[:6], "stability"):
        left.begin(what)
        clock.time += 1.0
    before = left.seconds
    left.begin("closed loop on the ellipse")
    assert left.seconds == before


def test_the_bar_moves_while_a_step_goes_on():
    clock = Clock()
    left = RemainingTime(clock)
    for what in SEARCH[:6]:
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
        line("effect 1: the best candidates refined")
    assert text.getvalue()[shown:].startswith("the answer")
    assert "more" in text.getvalue()


def test_the_elapsed_time_is_seen_next_to_a_long_name():
    screen = StringIO()
    console = Console(file=screen, force_terminal=True, width=60, color_system=None)
    with progress(console) as advance:
        advance(f"smoothing {'zigzag_31-Jul-2020_13_04_24, ' * 4}")
        advance._bar.refresh()
    assert "0:00:00 smoothing" in screen.getvalue()
