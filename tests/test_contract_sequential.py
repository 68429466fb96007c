"""Rounds of design, simulation and learning; representatives of a campaign; the answer of ``verify``."""

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from rich.console import Console

from cosim import InputError
from cosim.campaign import case_scenarios
from cosim.campaign.design import Case
from diagnosis import acceptance, parameters, verify
from diagnosis.acceptance.record.verification import Check
from diagnosis.acceptance.statistics import root_mean_square
from diagnosis.design import sequential
from diagnosis.execution.progress import ProgressLine
from diagnosis.fmu_parameters.parameter_file import CalibratedParameter, Prior

# Rounds


class Question(SimpleNamespace):
    """A question whose data and content are replaced."""


def verdict(name, **confidence):
    return {"verdict": name, "effects": [{"id": n, "confidence": c} for n, c in confidence.items()]}


@pytest.fixture
def played(monkeypatch, tmp_path):
    """Plays rounds with given verdicts, plans and ends of the simulation; returns them, and what was asked."""

    def play(verdicts, status="done"):
        asked, contents = [], iter(verdicts)
        plan = SimpleNamespace(write=lambda folder: asked.append(("plan", folder.name)))
        result = SimpleNamespace(status=status, message="it broke")

        def simulate(scenario, into, truth, **more):
            asked.append(("simulate", scenario.name, into.parent.name, more["seed"], truth))
            return result

        def begin(data, prior, model, advance):
            asked.append(("begin", data, prior, model))
            return SimpleNamespace(train=data, diagnose=lambda: None)

        monkeypatch.setattr(
            sequential,
            "plan_next",
            lambda q, n, seed, advance: asked.append(("design", q.data, seed)) or plan,
        )
        monkeypatch.setattr(sequential.cosim, "simulate", simulate)
        monkeypatch.setattr(sequential, "gather", lambda logs, model: [f"w{len(asked)}"])
        monkeypatch.setattr(sequential, "begin", begin)
        monkeypatch.setattr(sequential.ReportData, "of", lambda found: None)
        monkeypatch.setattr(sequential, "file_content", lambda report: next(contents))
        monkeypatch.setattr(sequential, "replace", lambda q, **more: Question(**(vars(q) | more)))
        q = Question(data=["old"], start="start", prior=0.1, content=None)
        return sequential.play(q, Path("truth.ssv"), tmp_path, len(verdicts), 5), asked

    return play


def test_rounds_go_on_until_every_effect_is_certain(played):
    found, asked = played(
        [
            verdict("ambiguous", a=0.99),
            verdict("found", a=0.99, b=0.9),
            verdict("found", a=0.95),
            verdict("none"),
        ]
    )
    assert [r.verdict for r in found] == ["ambiguous", "found", "found"]
    assert [r.certain for r in found] == [False, False, True]
    designs = [a[1:] for a in asked if a[0] == "design"]
    assert [seed for _, seed in designs] == [5, 6, 7]
    assert [len(data) for data, _ in designs] == [1, 2, 3], "all runs so far"
    assert [a[1:4] for a in asked if a[0] == "simulate"] == [
        ("scenario_1.json", f"round_{k}", 4 + k) for k in (1, 2, 3)
    ]
    assert [a[1] for a in asked if a[0] == "plan"] == ["round_1", "round_2", "round_3"]


def test_rounds_end_where_their_number_is_reached_or_a_run_fails(played):
    found, _ = played([verdict("ambiguous", a=None)] * 2)
    assert [r.effects for r in found] == [{"a": 0.0}] * 2
    with pytest.raises(InputError, match="the run of round 1 failed: it broke"):
        played([verdict("none")], status="failed")


# A campaign's runs that are tried


@pytest.mark.parametrize(
    ("values", "tried"),
    [
        ([1, 2, 3], {"1", "2", "3"}), ([*range(30)], {"0", "29"}), ([0.5 * k for k in range(30)], {"0.0", "14.5"}),
        ([*range(25), 2.5, -0.5], {"0", "24", "2.5", "-0.5"}), ([*range(25), True, "a.fmu"], {"0", "24", "true", '"a.fmu"'}),
        ([7] * 30, {"7"}), ([*range(20)], {str(k) for k in range(20)}), ([*range(21)], {"0", "20"}),
    ],
)  # fmt: skip
def test_of_many_numbers_the_ends_are_tried(values, tried):
    assert case_scenarios._tried(values) == tried


def test_each_value_is_tried_beside_each_choice():
    rows = [(c, k, n) for c in "ab" for k in (1.0, 2.0) for n in (0, 1, 2)]
    cases = [Case(i, {"c": c, "k": k, "n": n}, {}) for i, (c, k, n) in enumerate(rows)]
    found = [tuple(case.values.values()) for case in case_scenarios._representatives(cases)]
    for choice in "ab":
        own = [f for f in found if f[0] == choice]
        assert {k for _, k, _ in own} == {1.0, 2.0}
        assert {n for *_, n in own} == {0, 1, 2}
        assert len(own) == 4, "no more than that takes"
    assert found[0] == rows[0]


# Verification


@pytest.mark.parametrize(
    ("holds", "allowed", "code", "verdict"),
    [
        ([True, True], [False, False], 0, "The record holds."),
        ([True, None], [False, True], 0, "The record holds, but for 1 points that are allowed."),
        ([True, None, None], [False, True, False], 4, "not fully checked: 1 of 3 points are open."),
        ([None, False], [False, False], 1, "The record does not hold."),
    ],
)
def test_verify_says_each_point_and_the_whole(monkeypatch, capsys, holds, allowed, code, verdict):
    checks = [Check(h, f"point {k}", "", a) for k, (h, a) in enumerate(zip(holds, allowed, strict=True))]
    monkeypatch.setattr(acceptance, "verify_record", lambda record, key, allow: checks)
    assert verify.main(["validation.json"]) == code
    *lines, last = capsys.readouterr().out.splitlines()
    assert last.endswith(verdict)
    for k, line in enumerate(lines):
        assert line == f"{verify.SHOWN[holds[k]]}  point {k}{' (allowed)' if allowed[k] else ''}"
    assert len(lines) == len(holds)
    assert len(set(verify.SHOWN.values())) == 3


@pytest.mark.parametrize("n", [2.0, 2.5, 3.0, 3.9])
def test_bounds_of_an_rms_are_those_of_student_from_two_windows_on(n):
    stats = pytest.importorskip("scipy.stats")
    errors = np.array([1.0, 2.0, 2.5, 0.5])
    found = root_mean_square(errors, n, 0.9)
    half = stats.t.ppf(0.9, n - 1.0) * np.std(errors**2, ddof=1) / np.sqrt(n)
    mean = np.mean(errors**2)
    assert found == pytest.approx((mean**0.5, max(mean - half, 0.0) ** 0.5, (mean + half) ** 0.5))
    assert root_mean_square(errors, 1.99, 0.9)[1:] == (0.0, np.inf)


# Parameters


def text_of(parts):
    console = Console(width=160, record=True)
    for part in parts:
        console.print(part)
    return console.export_text().splitlines()


def test_parameters_are_listed_with_their_ranges_and_priors():
    each = [
        CalibratedParameter(name="k", unit="N/m", value=2.0, min=0.5, prior=Prior(std=0.5)),
        CalibratedParameter(name="d", value=4.0, log=True, prior=Prior(rel_std=0.25)),
    ]
    head, k, d = (line.split() for line in text_of([parameters._of_all(each)]))
    assert head == ["parameter", "value", "unit", "range", "prior", "of"]
    assert k[:7] == ["k", "2", "N/m", "0.5", "to", "±", "0.5"]
    assert d[:7] == ["d", "4", "1", "-", "±", "1", "(log)"]


def test_what_runs_determine_comes_best_first():
    p = [CalibratedParameter(name=n, value=1.0, prior=Prior(std=1.0)) for n in "abc"]
    each = [
        SimpleNamespace(parameter=p[0], std_share=0.5, change=1.0, known=True, fault=""),
        SimpleNamespace(parameter=p[1], std_share=0.1, change=2.0, known=True, fault="b: it fails"),
        SimpleNamespace(parameter=p[2], std_share=1.0, change=0.0, known=False, fault=""),
    ]
    lines = text_of(parameters._told(SimpleNamespace(each=each, together=[("a", "b")])))
    assert [line.split()[0] for line in lines[1:4]] == ["b", "a", "c"]
    assert lines[1].split()[-5:] == ["0.1", "of", "the", "prior's", "yes"]
    assert lines[3].split()[-3:] == ["no", "influence", "no"]
    assert lines[4:] == ["identifiable only together: a, b", "b: it fails"]


def test_a_line_of_progress_makes_room_while_something_else_is_printed():
    calls = []
    bar = SimpleNamespace(
        add_task=lambda *_, **__: 0,
        stop=lambda: calls.append("stop"),
        start=lambda: calls.append("start"),
    )
    line = ProgressLine(None, bar)

    def fail():
        with line.paused():
            assert calls == ["stop"]
            raise ValueError("inside")

    with pytest.raises(ValueError, match="inside"):
        fail()
    assert calls == ["stop", "start"]
