"""Commands that design runs, linearise FMUs and propose columns: what they say and write of given results."""

import json
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from cosim import InputError
from diagnosis import Counts, design_run, linearise, propose_columns
from diagnosis.fmu_parameters import measured_system, system_map
from diagnosis.runs import Column, Layout


def silent(_):
    """No progress."""


# The design of a run


def options(tmp_path, **more):
    given = {"diagnosis": tmp_path, "out": tmp_path / "out", "minutes": 2.0, "basin": None, "count": 2, "seed": 7,
             "simulate": Path("truth.ssv"), "criterion": "certainty"}  # fmt: skip
    return SimpleNamespace(**(given | more))


def rounds(certain):
    content = {"runs": [{"worst_distance": np.inf}], "seed": 7}
    plan = SimpleNamespace(lines=lambda: ["a line"], content=lambda: content)
    first = SimpleNamespace(effects={}, plan=plan, verdict="none", certain=False)
    last = SimpleNamespace(
        effects={"N_r": 0.96, "X_u": 0.5}, plan=plan, verdict="found", certain=certain
    )
    return [first, last]


@pytest.mark.parametrize("certain", [True, False])
def test_rounds_of_a_simulated_ship_are_told_and_written(tmp_path, monkeypatch, certain):
    from diagnosis.design import sequential

    asked = []
    monkeypatch.setattr(sequential, "play", lambda *of: asked.append(of) or rounds(certain))
    done = design_run._played(options(tmp_path), "question", silent)
    assert asked[0][:5] == ("question", Path("truth.ssv"), tmp_path / "out", 2, 7)
    shown = [*done[1]]
    assert shown[:3] == ["Round 1", "  a line", "  learned: no effect"]
    assert shown[5] == "  learned: N_r 96%, X_u 50%"
    assert shown[6] == (
        "Every effect found is certain." if certain else "The effects do not become certain."
    )
    reported = json.loads((tmp_path / "out" / "next.json").read_text())
    assert (reported["certain"], reported["seed"]) == (certain, 7)
    assert reported["runs"] == [{"worst_distance": None}], "JSON has no infinity"
    assert [r["folder"] for r in reported["rounds"]] == ["round_1", "round_2"]
    assert reported["rounds"][1] == {
        "folder": "round_2",
        "verdict": "found",
        "confidence": {"N_r": 0.96, "X_u": 0.5},
    }
    assert done[0] == 0


@pytest.mark.parametrize("advice", ["run with more yaw", ""])
def test_where_nothing_can_be_designed_the_advice_is_written(tmp_path, advice):
    content = {"effects": [{"advice": advice}], "possibilities": [{"advice": ""}]}
    code, shown = design_run._advised(options(tmp_path), content, tmp_path)[:2]
    wanted = [advice or "The diagnosis leaves no candidates that a run could discriminate."]
    assert code == 0
    assert shown[1:-1] == wanted
    assert shown[0].startswith("note: ")
    assert json.loads((tmp_path / "out" / "next.json").read_text())["advice"] == wanted


def test_inputs_are_planned_for_the_parameters_that_were_fitted(tmp_path, monkeypatch):
    from diagnosis.fmu_parameters import planned_inputs, system_task

    asked, is_system = [], [True]
    plan = SimpleNamespace(lines=lambda: ["half"], write=lambda out: ["next.json", "plan.md"])
    system = SimpleNamespace(parameters=[SimpleNamespace(name=n) for n in ("a", "b", "c")])
    monkeypatch.setattr(system_task, "is_system", lambda runs, given: is_system[0])
    monkeypatch.setattr(system_task, "system_task", lambda *of: asked.append(of) or system)
    monkeypatch.setattr(planned_inputs, "plan_inputs", lambda *of: asked.append(of) or plan)
    task = SimpleNamespace(model="m.fmu", map=None, runs=["r"], parameters="p.json", horizon=8.0)
    content = {"parameters": [{"name": "c", "z": 3.0}, {"name": "a", "z": 1.0}]}
    code, shown = design_run._of_fmu(options(tmp_path), content, task, silent)[:2]
    assert (code, shown) == (0, ["half", f"next.json, plan.md in {tmp_path / 'out'}"])
    assert asked[0] == ("m.fmu", None, {"train": ["r"]}, "p.json", 8.0)
    assert [p.name for p in asked[1][0].parameters] == ["a", "c"]
    assert asked[1][1:5] == ([1.0, 3.0], 120.0, 2, 7)
    with pytest.raises(InputError, match="has no parameter that was fitted"):
        design_run._of_fmu(options(tmp_path), {"parameters": []}, task, silent)
    is_system[0] = False
    with pytest.raises(InputError, match="parameters of a ship's FMU"):
        design_run._of_fmu(options(tmp_path), content, task, silent)
    task.model = None
    for given in (task, None):
        with pytest.raises(InputError, match="does not state its runs"):
            design_run._of_fmu(options(tmp_path), content, given, silent)


@pytest.mark.parametrize(
    ("of", "text", "value"),
    [
        (design_run._count, "1", 1), (design_run._count, "9", 9), (design_run._count, "10", None),
        (design_run._count, "0", None), (design_run._count, "x", None), (design_run._seed, "0", 0),
        (design_run._seed, str(2**31 - 1), 2**31 - 1), (design_run._seed, str(2**31), None), (design_run._seed, "-1", None),
        (design_run._criterion, "a-optimal", "a-optimal"), (design_run._criterion, "best", None),
    ],
)  # fmt: skip
def test_numbers_of_the_command_are_within_their_limits(of, text, value):
    if value is None:
        with pytest.raises(design_run.argparse.ArgumentTypeError):
            of(text)
    else:
        assert of(text) == value


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("[]", "is not the result"),
        ('{"effects": [], "verdict": ""}', "is not the result"),
        (None, "no diagnosis in"),
    ],
)
def test_a_folder_without_a_diagnosis_is_refused(tmp_path, text, message):
    if text is not None:
        (tmp_path / "diagnosis.json").write_text(text)
    with pytest.raises(InputError, match=message):
        design_run._diagnosis(tmp_path / "diagnosis.json")


def test_what_a_diagnosis_was_made_of_may_not_be_stated(tmp_path):
    path = tmp_path / "posterior.json"
    assert design_run._task(path) is None
    path.write_text("{}")
    assert design_run._task(path) is None
    path.write_text("[]")
    with pytest.raises(InputError, match="is not a posterior"):
        design_run._task(path)


# The linear model


def model():
    names = {"u_0": "parameter", "f": "input", "y": "output"}
    variables = [SimpleNamespace(name=n, causality=c, unit=None) for n, c in names.items()]
    return SimpleNamespace(
        reals=lambda causality=None: [v for v in variables if causality in (None, v.causality)],
        can_be_set=lambda v: v.causality != "output", variables={v.name: v for v in variables},
    )  # fmt: skip


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ('{"u_0": 1, "f": -2.5}', None), ("[1]", "must be an object of numbers"), ('{"y": 1}', "'y' cannot be set at the start"),
        ('{"u_0": true}', "must be a finite number"), ('{"u_0": "1"}', "must be a finite number"),
        ('{"u_0": 1e999}', "finite"),
    ],
)  # fmt: skip
def test_a_state_is_finite_numbers_of_what_can_be_set(tmp_path, text, message):
    path = tmp_path / "state.json"
    path.write_text(text)
    if message is None:
        assert linearise._read_state(path, model()) == {"u_0": 1.0, "f": -2.5}
    else:
        with pytest.raises(InputError, match=message):
            linearise._read_state(path, model())


def test_doubt_is_said_where_it_matters():
    assert linearise._doubt(linearise.NEGLIGIBLE) == []
    (line,) = linearise._doubt(0.25)
    assert line.startswith("A is uncertain by 25%")


def test_a_state_of_a_run_is_that_of_the_rest_of_it(monkeypatch):
    time = np.arange(5.0)
    whole = measured_system.MeasuredRun("a", time, {"f": 10.0 * time, "y": time})
    given = SimpleNamespace(
        inputs={"f": SimpleNamespace(name="force")}, outputs={"y": SimpleNamespace(name="y")}
    )
    seen = []

    def windows_of(rest, *_):
        seen.append(rest)
        course = SimpleNamespace(inputs=np.array([rest.columns["f"]]).T, start={"x_0": 4.0})
        return [SimpleNamespace(course=course), "next"]

    monkeypatch.setattr(measured_system, "read_runs", lambda paths, wanted: [whole])
    monkeypatch.setattr(measured_system, "columns_of", lambda run: ["f", "y"])
    monkeypatch.setattr(measured_system, "noises", lambda runs, of: np.ones(1))
    monkeypatch.setattr(measured_system, "windows_of", windows_of)
    monkeypatch.setattr(system_map, "map_by_names", lambda *of: given)
    asked = SimpleNamespace(run="a.csv", time=2.0)
    for of in (given, None):
        assert linearise._of_run(asked, None, of) == {"x_0": 4.0, "force": 20.0}
    assert seen[0].time.tolist() == [2.0, 3.0, 4.0]
    assert seen[0].columns["y"].tolist() == [2.0, 3.0, 4.0]
    asked.time = 0.0
    assert linearise._of_run(asked, None, given)["force"] == 0.0
    for beyond in (-0.1, 4.0, 4.1):
        asked.time = beyond
        with pytest.raises(InputError, match=r"must lie in the run 'a', 0 to 4 s"):
            linearise._of_run(asked, None, given)


# Columns


def column_options(tmp_path, *names, **more):
    files = [tmp_path / n for n in names]
    return SimpleNamespace(
        **({"file": files, "write": False, "overwrite": False, "ship": None, "anyway": False} | more)
    )


def likely(name, score):
    return SimpleNamespace(name=name, score=score, reasons=["unit", "name"])


def proposal(run="run", unused=(), blank=None):
    return SimpleNamespace(
        run=run, unused=[*unused], likely=blank or {}, needed={"columns": {}}, layout=Layout()
    )


def smoothed(name):
    track = SimpleNamespace(period=0.05, run=SimpleNamespace(name=name, time=np.array([1.0, 7.5])))
    counts = Counts(130, 4, 3, 2, 121)
    return SimpleNamespace(track=track, counts=counts, notes=["noted"], sensors=None)


def text_of(parts):
    from rich.console import Console

    console = Console(width=160, record=True)
    for part in parts:
        console.print(part)
    return console.export_text()


def test_blanks_are_said_once_by_the_measurement_that_shows_most(tmp_path):
    each = [
        proposal(blank={"x": [likely("a", 1.0)], "psi": []}),
        proposal(blank={"x": [likely("b", 0.9), likely("c", 0.9)]}),
    ]
    found = [*propose_columns._blanks(each, column_options(tmp_path))]
    assert found[:2] == [
        "blank: x; likely columns: 'b' (unit, name); 'c' (unit, name)", "blank: psi; likely columns: none",
    ]  # fmt: skip
    assert "one table" in found[2]
    assert found[3].startswith("put the columns' names into the blanks")
    assert [*propose_columns._blanks([proposal()], column_options(tmp_path))] == []
    forces = proposal(blank={f"tau_{a}": [] for a in "XYN"})
    assert any("--ship NAME" in t for t in propose_columns._blanks([forces], column_options(tmp_path)))
    named = column_options(tmp_path, ship="otter")
    assert not any("--ship NAME" in t for t in propose_columns._blanks([forces], named))


@pytest.mark.parametrize("write", [True, False])
def test_a_side_car_is_shown_and_written_where_it_is_wanted(tmp_path, write):
    target = tmp_path / "columns.json"
    head, text = propose_columns._stated(target, {"ö": 1}, write)
    assert head.startswith("written into" if write else "--write writes this into")
    assert text == '{\n  "ö": 1\n}'
    assert target.exists() == write
    if write:
        assert target.read_text(encoding="utf-8") == text + "\n"


@pytest.mark.parametrize(
    ("write", "overwrite", "there", "stated", "refused"),
    [
        (True, False, True, False, True), (False, False, True, False, False), (True, True, True, False, False),
        (True, False, False, False, False), (True, False, True, True, False),
    ],
)  # fmt: skip
def test_a_file_without_columns_is_not_replaced_unasked(
    tmp_path, write, overwrite, there, stated, refused
):
    target = tmp_path / "columns.json"
    if there:
        target.write_text("{}")
    asked = column_options(tmp_path, write=write, overwrite=overwrite)
    layout = Layout(columns={"x": Column(name="a")}) if stated else Layout()
    if refused:
        with pytest.raises(InputError, match="exists; --overwrite replaces it"):
            propose_columns._refuse_there(asked, target, layout)
    else:
        propose_columns._refuse_there(asked, target, layout)


def test_a_folder_has_one_table_of_its_measurements(tmp_path, monkeypatch):
    from diagnosis import runs

    proposals = {
        "a.csv": proposal("run", ["spare", "more"]), "b.csv": proposal("run", ["spare"]), "c.parquet": proposal(None),
    }  # fmt: skip
    own = {tmp_path / n: ({"x": Column(name="q")} if n == "b.csv" else {}) for n in proposals}
    common = Layout(columns={"y": Column(name="p")})
    read = []

    def smooth(run, craft, anyway, advance):
        if run == "b":
            raise InputError("b has no samples")
        return smoothed(run)

    monkeypatch.setattr(runs, "propose", lambda path, craft: proposals[path.name])
    monkeypatch.setattr(runs, "common_layout", lambda each: (common, own))
    monkeypatch.setattr(
        runs, "read", lambda path, layout, craft: read.append((path.name, layout.columns)) or path.stem
    )
    monkeypatch.setattr(runs, "stated_layout", lambda path: None)
    monkeypatch.setattr(runs, "channels_of", lambda s: [])
    monkeypatch.setattr(propose_columns, "_smoothed", smooth)
    asked = column_options(tmp_path, "a.csv", "b.csv", "c.parquet", "readme.txt", write=True)
    (tmp_path / "readme.txt").write_text("")
    code, shown = propose_columns._of_folder(asked, None, silent)[:2]
    text = text_of(shown)
    assert code == 0
    assert "not tables: readme.txt" in text
    assert "not used: spare, more" in text
    assert "not yet usable" not in text
    assert "not usable yet: b has no samples" in text
    assert text.count("a: noted") == 1
    rows = {
        line.split()[0]: line.split()[1:] for line in text.splitlines() if line[:2] in ("a.", "b.", "c.")
    }
    assert rows["a.csv"] == ["6.5", "s", "0.05", "s", "130", "4", "3", "2", "121"]
    assert set(rows["b.csv"]) == set(rows["c.parquet"]) == {"-"}
    assert [name for name, _ in read] == ["a.csv", "b.csv"]
    assert [*read[1][1]] == ["y", "x"]
    assert json.loads((tmp_path / "columns.json").read_text())["columns"]["y"]
    assert f"'{tmp_path / 'b.csv'}' also needs" in text.replace("\n", "")
    common = Layout()
    del own[tmp_path / "c.parquet"]
    shown = propose_columns._of_folder(column_options(tmp_path, "a.csv", "b.csv"), None, silent)[1]
    assert "--write writes" not in text_of(shown)


def test_files_of_several_folders_and_no_tables_are_refused(tmp_path):
    (tmp_path / "readme.txt").write_text("")
    with pytest.raises(InputError, match="none of these files is a CSV or Parquet file"):
        propose_columns._of_folder(column_options(tmp_path, "readme.txt", "readme.txt"), None, silent)
    with pytest.raises(InputError, match="in several: "):
        propose_columns._of_folder(column_options(tmp_path, "a.csv", "b/c.csv"), None, silent)


def test_entries_of_one_file_alone_are_said_unless_it_has_them(monkeypatch):
    from diagnosis import runs

    there = {"a.csv": Layout(columns={"x": Column(name="q")}), "b.csv": None}
    monkeypatch.setattr(runs, "stated_layout", lambda path: there[path.name])
    others = {Path("a.csv"): {"x": Column(name="q")}, Path("b.csv"): {"x": Column(name="q")}}
    (line,) = propose_columns._own_entries(others)
    assert line.startswith("'b.csv' also needs, in '")
    others[Path("a.csv")] = {"x": Column(name="other")}
    assert len([*propose_columns._own_entries(others)]) == 2


@pytest.mark.parametrize(
    ("length", "parts"),
    [
        (None, [(0, 7)]),
        (7.0, [(0, 7)]),
        (20.0, [(0, 7)]),
        (3.0, [(0, 3), (3, 6)]),
        (3.5, [(0, 3), (4, 7)]),
    ],
)
def test_windows_of_a_run_follow_each_other_and_hold_all_samples_of_a_whole_one(
    monkeypatch, length, parts
):
    run = measured_system.MeasuredRun("a", 2.0 + np.arange(8.0), {})
    monkeypatch.setattr(measured_system, "_window", lambda run, given, model, noise, rows: rows)
    monkeypatch.setattr(measured_system, "FEWEST", 3)
    found = measured_system.windows_of(run, None, None, None, length)
    assert [(rows[0], rows[-1]) for rows in found] == parts
    monkeypatch.setattr(measured_system, "FEWEST", 9)
    with pytest.raises(InputError, match="run 'a' has no window with 9 samples"):
        measured_system.windows_of(run, None, None, None, length)
