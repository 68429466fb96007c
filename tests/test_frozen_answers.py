"""Frozen answers of the diagnosis: what counts as a difference, and the table of cases."""

import json
from copy import deepcopy

import pytest

import diagnosis
from benchmarks.frozen_answers.case_answers import lasting, values
from benchmarks.frozen_answers.command_lines import CASES, CELLS, DESCRIBED
from benchmarks.frozen_answers.differences import compare, differences

ANSWER = {
    "exit": 0,
    "said": [],
    "diagnosis": {
        "verdict": "found",
        "effects": [{"id": "X_u", "confidence": 0.9, "indistinguishable": []}],
        "errors": [
            {"run": "a", "held_out": False, "window_position_rmse": {"before": 0.3, "after": 0.1}},
            {"run": "b", "held_out": True, "window_position_rmse": {"before": 0.3, "after": 0.1}},
        ],
        "calibrated": False,
    },
    "model": {"vessel.delta_X_u": -2.0},
}


def changed(**content):
    answer = deepcopy(ANSWER)
    answer["diagnosis"] |= content
    return answer


def test_an_answer_is_the_same_as_itself_within_the_tolerance():
    near = deepcopy(ANSWER)
    near["model"]["vessel.delta_X_u"] *= 1.0 + 1e-10
    assert not differences(ANSWER, near)
    assert list(differences(ANSWER, near, 1e-11).values) == ["model.vessel.delta_X_u"]
    assert not differences({"a": 0.0}, {"a": 1e-13})


@pytest.mark.parametrize(
    ("content", "stated"),
    [
        ({"verdict": "none"}, "verdict: found -> none"),
        ({"effects": []}, "effects: X_u -> "),
        ({"effects": [{"id": "X_u", "confidence": 0.8}]}, "confidence of X_u: 0.9 -> 0.8"),
        (
            {"errors": [{"run": "b", "use": "test", "window_position_rmse": {"after": 0.2}}]},
            "held-out position error of b: 0.1 -> 0.2",
        ),
    ],
)
def test_what_a_user_reads_first_is_reported_apart(content, stated):
    assert stated in differences(ANSWER, changed(**content)).notable


def test_a_small_change_of_confidence_differs_but_is_not_reported_apart():
    found = differences(
        ANSWER, changed(effects=[{"id": "X_u", "confidence": 0.905, "indistinguishable": []}])
    )
    assert list(found.values) == ["diagnosis.effects[0].confidence"]
    assert not found.notable


def test_keys_of_one_side_are_reported_apart_and_can_be_ignored():
    more = changed(use="train")
    found = differences(ANSWER, more)
    assert (found.values, found.before, found.after) == ({}, [], ["diagnosis.use"])
    assert not differences(ANSWER, more, ignored=["use"])
    assert differences(more, ANSWER).before == ["diagnosis.use"]


def test_true_is_not_one_and_an_empty_list_is_a_value():
    assert differences(ANSWER, changed(calibrated=0))
    assert differences({"a": []}, {"a": {}})


def test_folders_are_compared_file_by_file(tmp_path, capsys):
    for side, verdict in (("before", "found"), ("after", "none")):
        (tmp_path / side).mkdir()
        (tmp_path / side / "same.json").write_text(json.dumps(ANSWER))
        (tmp_path / side / "other.json").write_text(json.dumps(changed(verdict=verdict)))
    folders = tmp_path / "before", tmp_path / "after"
    assert compare(*folders, 1e-9, []) == 1
    shown = capsys.readouterr().out
    assert "other: verdict: found -> none" in shown
    assert "1 cases the same, 1 differ" in shown
    assert compare(*folders, 1e-9, ["verdict"]) == 0
    (folders[1] / "same.json").unlink()
    assert compare(*folders, 1e-9, ["verdict"]) == 1
    assert "only in one of the folders: same" in capsys.readouterr().out


def test_what_changes_from_run_to_run_is_left_out():
    assert lasting({"versions": {"numpy": "2"}, "a": [float("nan"), 1.5]}) == {"a": ["nan", 1.5]}


def test_the_values_of_a_parameter_set_are_read(tmp_path):
    diagnosis.write_model(tmp_path / "model.ssv", diagnosis.Model(vessel={"m": 18.0, "X_u": -1.25}))
    assert values(tmp_path / "model.ssv") == {"vessel.m": 18.0, "vessel.X_u": -1.25}


def test_the_cases_are_thirty_diagnoses_and_fifteen_comparisons_of_files_that_are_made():
    commands = [line.split()[0] for line in CASES.values()]
    assert commands.count("learn") >= 30
    assert commands.count("compare") == 15
    for line in CASES.values():
        for path in (word for word in line.split() if word.startswith(("cells/", "ships/"))):
            assert path.split("/")[1] in (CELLS if path.startswith("cells/") else DESCRIBED)
