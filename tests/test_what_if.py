"""The part of a report in which a reader moves the model: the page computes what Python does."""

import json
import re
from dataclasses import replace
from functools import partial
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
from support import reported
from support.chromium import Tab
from support.measured import sail, smoothed

from diagnosis import Comparison, Model, evaluate_run
from diagnosis.predictors import read_model, weak_windows
from diagnosis.predictors.prediction import predict
from diagnosis.predictors.ship_model import of_run
from diagnosis.predictors.traced.prediction_component import prediction_component
from diagnosis.report import ReportData, write_report
from diagnosis.report.reported_effect import ReportedCoefficient
from diagnosis.report.what_if import FIXED, MovableModel, what_if

HIDDEN = {"thrust_curve_deadband": 0.1, "thrust_curve_astern": -0.3}
LEARNED = HIDDEN | {"X_u": -0.1, "heading_offset": 0.01}
EVIL = "</script><script>alert(1)</script> \" onload='x"
CANDIDATES = ("thrust_curve", "earth_force", "lag", "mass")


@pytest.fixture(scope="module")
def data():
    runs = [sail(40.0, thrusters=HIDDEN, seed=k)[0] for k in range(2)]
    return [weak_windows(smoothed(replace(r, name=n))) for r, n in zip(runs, (EVIL, "b"), strict=True)]


def diagnosed(data, after, start=None):
    """The report of a diagnosis that learned a model of the first run."""
    found = [evaluate_run(w, start or Model(), after, held_out=k > 0) for k, w in enumerate(data)]
    comparison = Comparison(
        found, [np.full_like(e.before.omega, 0.01) for e in found], found[0].predictor
    )
    values = {n: ReportedCoefficient(x, "1", None, None) for n, x in HIDDEN.items()}
    values_of = {
        "thrust_curve": values,
        "heading_offset": {"heading_offset": ReportedCoefficient(0.01, "rad", None, None)},
    }
    effects = [reported.effect(name, 0.9, coefficients=own) for name, own in values_of.items()]
    ranking = [reported.ranked(name, float(k)) for k, name in enumerate(CANDIDATES)]
    std = {"thrust_curve_deadband": 0.01, "X_u": 0.05}
    posterior = SimpleNamespace(names=[], correlation=np.zeros((0, 0)), together=[], std=std)
    learned = reported.learned(ranking)
    return reported.report_data(
        comparison, reported.diagnosis(learned=learned, posterior=posterior), effects
    )


@pytest.fixture(scope="module")
def report(data):
    return diagnosed(data, Model().plus(LEARNED))


DRIVER = """(async () => {{
  const page = document, found = {{}};
  const results = () => page.querySelector("#what-if-results");
  const press = (text) => [...page.querySelectorAll("#what-if button")].find((b) => b.textContent === text).click();
  const numbers = (table) => [...table.querySelectorAll("td")].map((cell) => Number(cell.dataset.value));
  const errors = () => numbers(results().querySelectorAll("table")[0]);
  const forces = () => numbers(results().querySelectorAll("table")[1]);
  const choice = (name) => [...page.querySelectorAll("#what-if fieldset")].find((f) => f.querySelector("legend").textContent.trim().startsWith(name + " "));
  const move = (name, value) => {{
    const slider = page.querySelector(`#what-if input[aria-label^="${{name}} ["]`);
    slider.value = value;
    slider.dispatchEvent(new Event("input"));
  }};
  page.querySelector("#what-if details").open = true;
  while (!results().dataset.milliseconds) await new Promise((done) => setTimeout(done, 20));
  {script}
  return found;
}})()"""


OWN_RUN = r"""
const input = page.querySelector("#what-if input[type=file]");
const add = async (text) => {
  const moved = new DataTransfer();
  moved.items.add(new File([text], "<b>own</b>.csv"));
  input.files = moved.files;
  input.dispatchEvent(new Event("change"));
  const status = page.querySelector("#what-if-status"), before = status.textContent;
  while (status.textContent === before) await new Promise((done) => setTimeout(done, 20));
  return status.textContent;
};
found.wrong = await add("time,x,y,psi\n0,0,0,0");
found.said = await add(TEXT);
found.errors = errors();
found.bold = page.querySelectorAll("#what-if b").length;
"""


@pytest.fixture(scope="module")
def page(report, tmp_path_factory):
    return write_report(tmp_path_factory.mktemp("report") / "report.html", report)


@pytest.fixture
def driven(page, tmp_path):
    """A function that does something in the page, in JavaScript, and gives what that found."""
    with Tab(page, tmp_path) as tab:
        tab.wait("document.readyState === 'complete'")
        yield lambda script: tab.evaluate(DRIVER.format(script=script))
        assert tab.console == []


def test_component_predicts_as_windows_are_predicted(data):
    """Also behind effects on the measurement, and of a current; all of it as parameters."""
    model = Model().plus(LEARNED | {"V_n": 0.02, "marker_offset_dx": 0.05})
    names = [*LEARNED, "V_n", "marker_offset_dx", "mass"]
    e = evaluate_run(data[1], model)
    ((starts, _),) = e.windows.groups
    made = prediction_component(Model(), names, data[1].run, windy=False)
    p = made.params(*[model.value(n) for n in names])
    given, acting = (x[:, :, 0] for x in starts.arriving(model))
    (pose, rate), t = starts.motion(model), starts.first(lambda s: s.time)
    expected = predict(starts, model)[:, :, 0]
    for w in range(t.size):
        start = [*pose[:, w], *rate[:, w], t[w]]
        rows = np.concatenate([given[:, :, w], acting[:, :, w]], axis=1).tolist()
        s, found = made.init(made.inputs(*start, *rows[0]), p), []
        for row in rows:
            s, seen = made.prepared_step(s, made.inputs(*start, *row), made.prepared(p), starts.h)
            found.append(seen)
        assert np.allclose(found, expected[1:, :, w], rtol=0.0, atol=1e-9)


@pytest.mark.quick
def test_page_computes_the_errors_of_the_report_and_of_any_other_values(driven, report, data):
    found = driven(
        """found.first = errors(); press("Initial model"); found.initial = errors();
        move("thrust_curve_deadband", 0.05); move("F_n", 0.1); found.moved = errors(); found.forces = forces();
        press("Learned model"); found.again = errors();"""
    )
    expected = [
        [e.before.position, e.after.position, e.before.heading, e.after.heading]
        for e in report.evaluations
    ]
    forces = np.reshape(found.pop("forces"), (2, 3, 3))
    rows = {name: np.reshape(values, (2, 6)) for name, values in found.items()}
    assert np.allclose(rows["first"][:, [0, 2, 3, 5]], expected, rtol=1e-6, atol=0.0)
    assert np.array_equal(rows["first"], rows["again"])
    assert np.array_equal(rows["initial"][:, 2], rows["first"][:, 0])
    # A slider ticks the whole effect, with the learned values of the others.
    other = Model().plus({"thrust_curve_deadband": 0.05, "thrust_curve_astern": -0.3, "F_n": 0.1})
    known = [evaluate_run(w, other).before for w in data]
    assert np.allclose(
        rows["moved"][:, [2, 5]], [[e.position, e.heading] for e in known], rtol=1e-6, atol=0.0
    )
    stated = [[e.before.omega_rms, e.after.omega_rms] for e in report.evaluations]
    assert np.allclose(np.moveaxis(forces[:, :, :2], 1, 2), stated, rtol=1e-6, atol=0.0)
    assert np.allclose(forces[:, :, 2], [e.omega_rms for e in known], rtol=1e-6, atol=0.0)
    assert (np.abs(rows["moved"][:, 2] / rows["initial"][:, 2] - 1.0) > 0.1).all()


def test_fit_of_what_is_ticked_lowers_the_errors_and_is_saved(driven, report, data, tmp_path):
    found = driven(
        """let saved; page.defaultView.HTMLAnchorElement.prototype.click = () => {}; page.defaultView.URL.createObjectURL = (blob) => { saved = blob; return "#"; };
        press("Initial model"); choice("thrust_curve").querySelector("input").click();
        move("thrust_curve_astern", 0.0); move("thrust_curve_deadband", 0.01);
        press("Fit this"); found.errors = errors(); found.said = page.querySelector("#what-if-status").textContent;
        press("Save model.ssv"); found.file = await saved.text();"""
    )
    assert found["said"].startswith("Fitted 3 values to the training runs")
    rows = np.reshape(found["errors"], (2, 6))
    assert (rows[:, 2] < 0.2 * rows[:, 0]).all()
    path = tmp_path / "model.ssv"
    path.write_text(found["file"], encoding="utf-8")
    assert "not checked for soundness" in found["file"]
    model = read_model(path)
    assert model.thrusters["thrust_curve_deadband"] == pytest.approx(0.1, abs=0.02)
    assert not model.vessel
    again = [evaluate_run(w, model).before.position for w in data]
    assert np.allclose(rows[:, 2], again, rtol=1e-6, atol=0.0)


def test_own_run_is_compared_as_the_report_compares_it(driven, report, data):
    """From a file, by windows that start from the poses about their starts in place of a smoother."""
    run = data[1].run
    table = pd.DataFrame(np.column_stack([run.time, run.pose, run.tau_cmd]))
    text = json.dumps(table.to_csv(index=False, header=["time", "x", "y", "psi", *run.commanded]))
    found = driven(OWN_RUN.replace("TEXT", text))
    assert found["wrong"] == "<b>own</b>.csv has no column tau_X, tau_Y, tau_N"
    assert found["said"] == "<b>own</b>.csv: 5 windows compared."
    assert found["bold"] == 0
    rows = np.array(found["errors"], float).reshape(3, 6)
    assert np.allclose(rows[2, [0, 2, 3, 5]], rows[1, [0, 2, 3, 5]], rtol=0.25)


def test_what_changes_the_past_of_commands_stays_as_it_is(report):
    choices = {c.name: c for c in MovableModel(report).choices}
    assert choices["lag"].fixed == FIXED
    assert choices["mass"].fixed == choices["X_u"].fixed == ""
    assert [s.ci95 is not None for s in choices["thrust_curve"].sliders] == [False, False, True]
    assert choices["X_u"].sliders[0].std
    assert not choices["earth_force"].ticked
    assert choices["thrust_curve"].ticked


def test_page_says_why_a_model_cannot_be_changed(data, report, tmp_path, monkeypatch):
    assert what_if(ReportData(report.comparison)) == ("", "")
    behind = diagnosed(data[:1], replace(Model(), measurement={"position_lag": 0.2}))
    assert "behind a filter" in what_if(behind).missing
    monkeypatch.setattr("diagnosis.report.what_if.webassembly_of", lambda movable: None)
    text = write_report(tmp_path / "report.html", report).read_text(encoding="utf-8")
    words = re.sub(r"<[^>]+>", "", text)  # without the links of terms
    assert "The model cannot be changed in this page: an effect cannot be translated" in words
    assert "<script" not in text
    assert "wasm-unsafe-eval" not in text


def test_page_runs_its_own_program_alone(page):
    text = page.read_text(encoding="utf-8")
    assert re.search(
        r"default-src 'none'; style-src 'unsafe-inline'; script-src 'sha256-[\w+/=]+' 'wasm-unsafe-eval'\"",
        text,
    )
    assert len(re.findall("<script", text)) == 2
    assert EVIL not in text
    assert "innerHTML" not in text


def test_a_term_that_a_calibration_added_is_ticked(data):
    """It is no finding, and the learned model has it all the same."""
    effect = Model().ship.effects["N_ur"]
    (name,) = (p.name for p in effect.parameters)
    choices = {c.name: c for c in MovableModel(diagnosed(data, Model().plus({name: 0.3})))._choices()}
    (slider,) = choices["N_ur"].sliders
    assert choices["N_ur"].ticked
    assert (slider.before, slider.after) == (0.0, pytest.approx(0.3))


def test_each_run_has_the_value_that_its_prediction_has_where_values_differ_by_run():
    """Of a run without one it is that of other runs."""
    own = {of_run("delta_X_absu_u", "a"): -2.0, of_run("delta_X_absu_u", "b"): -4.0}
    learned = Model(vessel={"delta_X_absu_u": -2.5}).plus({n: x + 2.5 for n, x in own.items()})
    of = SimpleNamespace(
        runs=[SimpleNamespace(name=name) for name in "abc"],
        learned=learned,
        start=Model(),
        diagnosis=SimpleNamespace(posterior=SimpleNamespace(std={})),
        _movable=lambda sliders: ("", sliders),
    )
    of._slider = partial(MovableModel._slider, of)
    effect = learned.ship.effects["X_|u|u"]
    sliders = MovableModel._choice(of, effect, "found", {}, True).sliders
    assert [(s.run, s.after) for s in sliders] == [(0, -2.0), (1, -4.0), (2, -2.5)]
