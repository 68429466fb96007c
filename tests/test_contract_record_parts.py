"""A validation record in parts: what the judged data cover, pictures, sections, and hashes of what decides."""

import hashlib
from types import SimpleNamespace

import numpy as np
import pytest

from cosim import InputError
from diagnosis.acceptance import validity
from diagnosis.acceptance.budget import Budget
from diagnosis.acceptance.criterion import Criterion
from diagnosis.acceptance.judged_criterion import JudgedErrors
from diagnosis.acceptance.record import provenance, record_figures, sections
from diagnosis.acceptance.statistics import Interval
from diagnosis.predictors import Model
from diagnosis.report.content import Content

N = 12

# What the judged data cover


def run(monkeypatch, nu=None):
    nu = np.column_stack([np.arange(N), np.full(N, -1.0), 0.1 * np.arange(N)]) if nu is None else nu
    smoothed = SimpleNamespace(nu=nu, time=np.arange(N) * 1.0, used=np.arange(N) != 3)
    given = {"x": np.zeros(N), "psi": np.zeros(N), "tau_X": 2.0 * np.arange(N)}
    monkeypatch.setattr(validity, "at_samples", lambda s: given)
    return smoothed


def test_signals_are_motion_and_commands(monkeypatch):
    nu = np.array([[3.0, -4.0, 0.1], [0.0, 2.0, 0.2], [0.2, 0.1, 0.0], [-1.0, -0.1, 0.0]])
    found = validity.signals(run(monkeypatch, nu))
    assert found.keys() == {"u", "v", "r", "speed", "drift", "tau_X"}
    assert found["speed"] == pytest.approx([5.0, 2.0, np.hypot(0.2, 0.1), np.hypot(1.0, 0.1)])
    assert found["drift"] == pytest.approx(
        [np.arctan2(4.0, 3.0), -0.5 * np.pi, np.nan, np.arctan2(0.1, -1.0)], nan_ok=True
    )


def test_means_are_over_what_is_known_of_each_window(monkeypatch):
    smoothed = run(monkeypatch)
    smoothed.nu[5, 0] = np.nan
    smoothed.nu[8:11, 0] = np.nan
    p = SimpleNamespace(smoothed=smoothed, first=np.array([0, 4, 8]), rows=np.array([3, 7, 10]))
    found = validity.window_means(p)
    assert found["u"] == pytest.approx([1.5, (4 + 6 + 7) / 3, np.nan], nan_ok=True)
    assert found["tau_X"] == pytest.approx([3.0, 11.0, 18.0])


def test_the_range_is_that_of_the_samples_that_are_used_of_windows_that_count(monkeypatch):
    smoothed = run(monkeypatch)
    smoothed.nu[6, 0] = np.nan
    p = SimpleNamespace(
        name="a", smoothed=smoothed, first=np.array([0, 4, 8]), rows=np.array([3, 7, 11])
    )
    ship = SimpleNamespace(commands={"tau_X": "N"})
    e = SimpleNamespace(model=SimpleNamespace(ship=ship))
    chosen = np.array([True, True, False])
    found = {row["signal"]: row for row in validity.covered([(p, chosen), (p, chosen)], {"a": e})}
    u = [0, 1, 2, 4, 5, 7]  # without row 3, that is not used, and row 6
    wanted = np.quantile(u * 2, [0.0, 0.05, 0.5, 0.95, 1.0])
    assert [found["u"][q] for q in ("least", "q05", "median", "q95", "greatest")] == pytest.approx(
        wanted
    )
    assert (found["u"]["unit"], found["tau_X"]["unit"]) == ("m/s", "N")
    assert found["tau_X"]["greatest"] == 14.0
    assert validity.covered([(p, np.zeros(3, bool))], {"a": e}) == []


@pytest.mark.parametrize(
    ("signal", "unit"),
    [("r", "rad/s"), ("propeller.n", "1/s"), ("rudder.delta", "rad"), ("tau_N", "N.m"), ("u_bow", "1")],
)
def test_units_are_those_of_si(signal, unit):
    commands = {"propeller.n": "1/s", "rudder.delta": "rad"}
    e = SimpleNamespace(model=SimpleNamespace(ship=SimpleNamespace(commands=commands)))
    assert validity.unit_of(signal, e) == unit


# Pictures


def judged(errors, run=None, quantity="heading", unit="deg"):
    c = Criterion(quantity=quantity, horizon=8.0, tolerance=2.0, unit=unit)
    errors = np.array(errors) * c.factor
    run = np.zeros(errors.size, int) if run is None else np.array(run)
    spent = Budget(0.25 * c.factor, *[None] * 6)
    return c, JudgedErrors(run, errors, np.zeros(2), 3.0, Interval(0.5, 0.1, 0.9), spent)


def test_errors_are_shown_within_and_beyond_their_tolerance():
    c, found = judged([1.0, -2.0, 2.5, -3.0], [0, 0, 1, 1])
    (panel,) = record_figures._errors(c, found).panels
    by_label = {m.label: m for m in panel.marks if m.label}
    assert by_label["within"].x.tolist() == [1, 2]
    assert by_label["within"].y == pytest.approx([1.0, -2.0])
    assert by_label["beyond"].x.tolist() == [3, 4]
    assert by_label["beyond"].y == pytest.approx([2.5, -3.0])
    assert by_label["tolerance"].y.tolist() == [2.0, 2.0]
    band = by_label["2 u_val"]
    assert (np.nanmin(band.y), np.nanmax(band.y)) == pytest.approx((-0.5, 0.5))
    lines = [m for m in panel.marks if not m.label]
    assert [m.x.tolist() for m in lines] == [[2.5, 2.5], [0, 5]]
    assert [m.y.tolist() for m in lines] == [[-2.0, 2.0], [-2.0, -2.0]]
    assert (panel.zero, panel.x.limits, panel.y.label) == (True, (0, 5), "heading [deg]")


def test_distances_have_no_side_below_zero():
    c, found = judged([1.0, 2.5], quantity="position", unit="cm")
    (panel,) = record_figures._errors(c, found).panels
    assert np.nanmin(np.concatenate([m.y for m in panel.marks])) == 0.0
    assert [m for m in panel.marks if not m.label] == []


def test_tracks_are_drawn_once_for_each_horizon(monkeypatch):
    monkeypatch.setattr(record_figures, "_track", lambda e, p: (e.name, p))
    monkeypatch.setattr(record_figures, "_errors", lambda c, found: c.title)
    c, found = judged([1.0, 2.0])
    names = [f"r{k}" for k in range(record_figures.SHOWN + 1)]
    windows = [(SimpleNamespace(name=n, predictions=n), np.array([True, False, True])) for n in names]
    judgement = SimpleNamespace(criterion=c, found=found, windows=windows)
    other = SimpleNamespace(
        criterion=c.model_copy(update={"horizon": 4.0}), found=found, windows=windows[:1]
    )
    nothing = SimpleNamespace(criterion=c, found=None, windows=[])
    evaluations = [SimpleNamespace(name=n) for n in names]
    plots = [*record_figures.figures([nothing, judgement, judgement, other], evaluations)]
    shown = [p.figure for p in plots]
    tracks = [(n, n) for n in names[:-1]]
    assert shown == [
        "heading after 8 s",
        *tracks,
        "heading after 8 s",
        "heading after 4 s",
        ("r0", "r0"),
    ]
    assert "each of the 2 windows that count" in plots[0].caption
    more = f"of which 2 count (of {len(names)} runs the first {record_figures.SHOWN})."
    assert plots[1].caption.endswith(more)
    assert plots[-1].caption.endswith("of which 2 count.")
    assert len([*record_figures.figures([judgement], [])]) == 1


# Sections


def content(**changes):
    budget = dict.fromkeys(sections.SOURCES, 0.01) | {"current": None, "unknown": ["current", "wind"]}
    numbers = {"tolerance": 1.0, "E": 0.2, "E_axes": [0.1, -0.1], "rms": 0.3, "largest": 0.5,
               "independent": 7.5, "estimate": 0.9, "low": 0.8, "high": 1.0, "k_u_val": 0.04}  # fmt: skip
    first = {
        "criterion": "c", "requirement": "r", "outcome": "met", "flags": ["look"], "reason": "why", "unit": "m",
        "excluded": {"too few": 3}, "offered": 12, "windows": 9, "runs": ["a"], "left_out": {"b": "short"},
        "restrictions": ["only runs a"], "budget": budget, **numbers,
    }  # fmt: skip
    second = first | {"criterion": "d", "flags": [], "budget": None, "E_axes": None, "excluded": {}, "runs": [],
                      "restrictions": [], "left_out": {}}  # fmt: skip
    sample = {"run": "a", "samples": 9, "used": 8, "frozen": 1, "dropped": 0, "spikes": 2, "notes": ["n"],
              "sha256": "sa"}  # fmt: skip
    made = {
        "particulars": {"ship": "s"}, "criteria": {"purpose": None, "path": "p", "modified": "m", "read": "r",
                                                    "sha256": "hash"},
        "judgements": [first, second], "validity": [{"criterion": "c", "signal": "u", "unit": "m/s", "a": 1.0,
                                                     "b": 2.0, "c": 3.0, "d": 4.0, "e": 5.0}],
        "sensors": [], "not_covered": ["x"], "notes": [], "standing": "st", "references": ["ref"],
        "samples": [sample], "same_runs": [["a", "b"]], "learned_from": [], "made": "t", "command": "cmd",
        "model": "m.fmu", "confinement": "none", "ship": "s", "files": [{"role": "data", "path": "a.csv",
                                                                          "sha256": "f"}],
        "hashes": {"ship": "hs", "parameters": "hp"}, "versions": {"python": "3"}, "public_key": None, "fmu": None,
        "code": {"version": "1", "revision": None, "sha256": "co", "libraries": {"numpy": "2"}},
    }  # fmt: skip
    return Content.of(made | changes)


def section(heading, **changes):
    return {s.heading: s for s in sections.sections(content(**changes))}.get(heading)


def test_a_report_has_its_sections_in_order():
    headings = [s.heading for s in sections.sections(content())]
    assert headings == [
        "Verdict", "Judged model and data", "Comparison error", "Uncertainty", "Particulars", "Validity range",
        "Faults of sensors", "Limits of the validation", "Made with", "Terms and standing",
    ]  # fmt: skip
    assert section("Notes", notes=["a note"]).text == ["a note"]
    assert section("Validity range").tables[0].rows[0][3:] == ("1", "2", "3", "4", "5")
    assert section("Particulars").text == ["Intended use: not given. As the criteria state:"]
    faults = section("Faults of sensors", sensors=[{"run": "a", "sentence": "r is late"}])
    assert faults.text == ["a: r is late"]
    assert section("Faults of sensors").text == ["The channels do not contradict each other."]


def test_a_verdict_has_its_error_and_warnings():
    found = section("Verdict")
    first, second = found.tables[0].rows
    assert first == ("c: r", "met, with a warning", "0.2 ± 0.04 m or more, 2 sources not known", "why")
    assert second == ("d: r", "met", sections.NO_VALUE, "why")
    assert found.text == ["Warning. c: look"]
    assert (
        sections._error(Content.of({"budget": {"unknown": []}, "E": 1.0, "k_u_val": 0.5, "unit": "m"}))
        == "1 ± 0.5 m"
    )


def test_the_judged_data_say_what_counts_and_why_not():
    found = section("Judged model and data")
    assert found.tables[0].rows == [
        ("c", "12", "3: too few", "9", "1 of 1: a"), ("d", "12", "none", "9", "0 of 1: none"),
    ]  # fmt: skip
    assert found.text == [
        "c: only runs a.", "Runs that do not count: b: short.", "The same motion, or nearly: a and b.",
        "a: 9 samples, of which 8 are used, 1 frozen, 0 dropped, 2 spikes. n.",
        "The file of the model does not name its training runs.",
    ]  # fmt: skip
    learned = section("Judged model and data", learned_from=[{"name": "x"}, {"name": "y"}], same_runs=[])
    assert learned.text[-1] == "The model was learned from: x, y."


def test_tables_of_error_and_uncertainty_have_what_is_known():
    first, second = section("Comparison error").tables[0].rows
    assert first[:6] == ("c", "m", "1", "0.2", "0.1, −0.1", "0.3")
    assert first[7:] == ("9, 7.5 independent", "0.9 (0.8 to 1)")
    assert second[4] == sections.NO_VALUE
    table = section("Uncertainty").tables[0]
    (row,) = table.rows
    assert row[2 + sections.SOURCES.index("current")] == "not known"
    assert row[2] == "0.01"
    assert table.header[2:5] == ("measurement u_D", "initial state", "parameters")


def test_what_it_was_made_with_is_named():
    rows = dict(section("Made with").tables[0].rows)
    assert rows["data"] == "a.csv, SHA-256 f"
    assert rows["samples of a"] == "SHA-256 sa"
    assert rows["cybership"] == "1, revision not known, SHA-256 co"
    assert rows["libraries"] == "python 3, numpy 2"
    assert rows["signed"] == "no"
    assert dict(section("Made with", public_key="KEY").tables[0].rows)["signed"] == "KEY"
    assert section("Made with", fmu={"sentences": ["s"]}).text == ["s"]


# Hashes


def test_a_file_is_hashed_and_must_be_the_one_that_was_read(tmp_path):
    file = tmp_path / "a.csv"
    file.write_text("1,2")
    found = hashlib.sha256(b"1,2").hexdigest()
    assert provenance.entry("data", file) == {"role": "data", "path": str(file), "sha256": found}
    assert provenance.entry("data", file, found)["sha256"] == found
    with pytest.raises(InputError, match="has changed since the comparison"):
        provenance.entry("data", file, "other")
    with pytest.raises(InputError, match="cannot be read again"):
        provenance.entry("data", tmp_path / "none")


def comparison(tmp_path, **predictor):
    (tmp_path / "a.csv").write_text("data")
    (tmp_path / "a.csv.json").write_text("layout")
    (tmp_path / "m.fmu").write_text("fmu")
    hashes = {
        tmp_path / n: hashlib.sha256(t).hexdigest()
        for n, t in (("a.csv", b"data"), ("a.csv.json", b"layout"))
    }
    run = SimpleNamespace(file=tmp_path / "a.csv", hashes=hashes)
    model = Model()
    e = SimpleNamespace(
        name="a", weak_windows=SimpleNamespace(run=run), model=model, learned=None,
        smoothed=SimpleNamespace(notes=("n",), counts=None),
    )  # fmt: skip
    made = SimpleNamespace(
        **(
            {"files": [("model", tmp_path / "m.fmu", "")], "model": model, "parametric": True}
            | predictor
        )
    )
    return SimpleNamespace(evaluations=[e], predictor=made)


@pytest.fixture
def ours(monkeypatch):
    """A predictor of the project; returns the modules that seem to be imported."""
    monkeypatch.setattr(provenance, "foreign", lambda predictor: False)
    modules = {"sys": SimpleNamespace()}
    monkeypatch.setattr(provenance, "sys", SimpleNamespace(modules=modules))
    return modules


def test_files_are_data_layout_and_model_each_once(tmp_path, ours):
    made = comparison(tmp_path)
    further = {
        "model": str(tmp_path / "m.fmu"),
        "learned": None,
        "effects": "installed",
        "map": [tmp_path / "a.csv"],
    }
    found = provenance.files_of(made, further)
    assert [f["role"] for f in found] == ["data", "layout of data", "model"]
    more = tmp_path / "map.json"
    more.write_text("map")
    assert provenance.files_of(made, {"map": more})[-1]["path"] == str(more)
    with pytest.raises(InputError, match="is not the model that was compared"):
        provenance.files_of(made, {"model": more})


def test_a_parameter_set_is_the_model_where_its_numbers_are(tmp_path, ours, monkeypatch):
    made = comparison(tmp_path, files=[])
    ssv = tmp_path / "model.ssv"
    ssv.write_text("ssv")
    monkeypatch.setattr(provenance, "read_model", lambda path, ship: Model())
    assert provenance.files_of(made, {"model": ssv})[-1]["role"] == "model"
    monkeypatch.setattr(provenance, "read_model", lambda path, ship: Model({"delta_X_u": 1.0}))
    with pytest.raises(InputError, match="is not the model"):
        provenance.files_of(made, {"model": ssv})
    monkeypatch.setattr(provenance, "read_model", lambda path, ship: Model())
    made.predictor.parametric = False
    with pytest.raises(InputError, match="is not the model"):
        provenance.files_of(made, {"model": ssv})


def test_modules_next_to_a_model_of_a_user_are_hashed(tmp_path, ours):
    for name in ("own.py", "helper.py"):
        (tmp_path / name).write_text(name)
    made = comparison(tmp_path, files=[("model", tmp_path / "own.py", "")])
    ours["helper_of_own"] = SimpleNamespace(__file__=str(tmp_path / "helper.py"))
    found = provenance.files_of(made, {})
    assert [(f["role"], f["path"].rpartition("/")[2]) for f in found[2:]] == [
        ("model", "own.py"),
        ("module", "helper.py"),
    ]


def test_a_class_is_foreign_unless_the_project_has_it(monkeypatch):
    assert not provenance.foreign(Model())
    assert provenance.foreign(SimpleNamespace())
    assert provenance._ours(provenance.PROJECT / "fmus" / "hull.py")
    assert not provenance._ours(provenance.PROJECT / "tests" / "conftest.py")


def test_numbers_of_a_model_have_a_hash_of_their_own(tmp_path):
    made = comparison(tmp_path)
    plain = provenance.parameters_sha256(made)
    made.evaluations[0].learned = Model({"delta_X_u": 1.0})
    learned = provenance.parameters_sha256(made)
    assert (plain["ship"] == learned["ship"], plain["parameters"] == learned["parameters"]) == (
        True,
        False,
    )
    assert provenance.parameters_of(Model({"a": 1.0})) != provenance.parameters_of(Model({}, {"a": 1.0}))
    assert provenance.parameters_of(Model(measurement={"a": 1.0})) != provenance.parameters_of(Model())


def test_the_code_is_hashed_by_its_sources(tmp_path, monkeypatch):
    provenance.code.cache_clear()
    for name in ("fmus", "cosim", "tests"):
        (tmp_path / name / "sub").mkdir(parents=True)
        (tmp_path / name / "sub" / "a.py").write_text(name)
    (tmp_path / "fmus" / "a.txt").write_text("text")
    monkeypatch.setattr(provenance, "PROJECT", tmp_path)
    first = provenance.code.__wrapped__()
    assert first["revision"] is None
    assert first["libraries"]["numpy"] == np.__version__
    text = b"fmus/sub/a.py\0fmuscosim/sub/a.py\0cosim"
    assert first["sha256"] == hashlib.sha256(text).hexdigest()
    assert provenance._version("no such library") is None
    (tmp_path / ".git").mkdir()

    def git(command, **_):
        return SimpleNamespace(stdout="abc\n" if "rev-parse" in command else " M a.py\n")

    monkeypatch.setattr(provenance.subprocess, "run", git)
    assert provenance._revision() == "abc, with changes"
    monkeypatch.setattr(provenance.subprocess, "run", lambda command, **_: SimpleNamespace(
        stdout="abc\n" if "rev-parse" in command else ""))  # fmt: skip
    assert provenance._revision() == "abc"


def test_samples_are_listed_for_each_run(tmp_path, monkeypatch):
    made = comparison(tmp_path)
    monkeypatch.setattr(provenance, "samples_sha256", lambda smoothed: "hash")
    monkeypatch.setattr(provenance, "COUNTS", "samples used")
    made.evaluations[0].smoothed.counts = SimpleNamespace(samples=9, used=8)
    (row,) = provenance.samples(made.evaluations)
    assert row == {
        "run": "a",
        "file": str(tmp_path / "a.csv"),
        "sha256": "hash",
        "samples": 9,
        "used": 8,
        "notes": ["n"],
    }
    made.evaluations[0].weak_windows.run.file = None
    assert provenance.samples(made.evaluations)[0]["file"] == ""
