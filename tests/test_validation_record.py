"""A validation record states what was judged, by what, of which data, and with which uncertainty."""

import json
import time
from dataclasses import replace
from datetime import datetime
from hashlib import sha256
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
from support.acceptance import EASY, validated
from support.measured import csv_of, jumps, sail
from support.own_effects import LINEAR

import diagnosis
from cosim import InputError
from cosim.campaign import Posterior
from diagnosis.acceptance import FILES, lines
from diagnosis.acceptance.budget import Learned, _numerical, sources_of
from diagnosis.acceptance.criterion import Criterion, InputStd, now
from diagnosis.acceptance.judged_criterion import Predicted, judge
from diagnosis.acceptance.predictions import Predictions
from diagnosis.acceptance.record.provenance import files_of
from diagnosis.predictors import Model, ship_with, write_model
from diagnosis.predictors.described_ship import DescribedShip
from diagnosis.predictors.fmu.lineage import remember
from diagnosis.runs import Fingerprint
from diagnosis.search.prediction_fit.disturbance import ForceDisturbance
from diagnosis.verify import main as verify_main
from fmus.build import build, native_targets

pypdf = pytest.importorskip("pypdf")


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Three runs, of which the second is the first at other times."""
    made = tmp_path_factory.mktemp("runs")
    run = sail(48.0, h=0.1)[0]
    csv_of(run, made / "a.csv")
    csv_of(replace(run, time=run.time + 7.0), made / "again.csv")
    csv_of(sail(48.0, h=0.1, given=jumps)[0], made / "b.csv")
    return made


@pytest.fixture(scope="module")
def comparison(folder):
    return diagnosis.compare([folder / f"{name}.csv" for name in ("a", "again", "b")])


def test_restrictions_and_counts_are_in_the_record(comparison, tmp_path):
    v = validated(comparison, tmp_path, {}, {"operating_range": {"u": [-0.5, 0.1]}, "runs": ["a", "b"]})
    free, narrow = v.content.judgements
    assert narrow.requirement.endswith(
        "only runs a, b; only windows with a mean of u from -0.5 to 0.1 m/s"
    )
    assert (len(narrow.restrictions), free.restrictions) == (2, [])
    assert (free.runs, free.left_out) == (["a", "b"], {"again": "the same motion as a, which counts"})
    for j in (free, narrow):
        assert j.offered == j.windows + sum(j.excluded.values())
    assert 0 < narrow.excluded["mean u not from -0.5 to 0.1"] < free.windows
    assert narrow.excluded["not among the runs of the criterion"] > 0
    stated = [*lines(v.content)]
    assert f"{narrow.windows} of {narrow.offered} windows of 2 of 3 runs count" in stated[1]
    assert v.content.criteria.content["criteria"][1]["operating_range"] == {"u": [-0.5, 0.1]}


@pytest.mark.slow
def test_the_range_of_validity_is_that_of_what_was_judged(comparison, tmp_path):
    v = validated(
        comparison, tmp_path, {"name": "all"}, {"name": "slow", "operating_range": {"u": [-0.5, 0.1]}}
    )
    most = {r.criterion: r.greatest for r in v.content.validity if r.signal == "u"}
    assert most["slow"] < most["all"]


def test_a_run_counts_once_and_the_other_where_the_first_does_not(comparison, tmp_path):
    v = validated(comparison, tmp_path, {}, {"runs": ["again"]})
    assert v.content.same_runs == [["a", "again"]]
    assert v.content.judgements[1].runs == ["again"]


@pytest.mark.slow
def test_runs_that_a_model_was_learned_from_do_not_count_without_a_word(folder, comparison, tmp_path):
    (first, *_) = comparison.evaluations
    write_model(tmp_path / "model.ssv", Model(learned_from=(Fingerprint.of(first.smoothed),)))
    c = diagnosis.compare([folder / "again.csv", folder / "b.csv"], model=tmp_path / "model.ssv")
    v = validated(c, tmp_path, {}, {"runs": ["again"]}, {"training_runs": True})
    strict, alone, lenient = v.content.judgements
    assert (strict.runs, strict.left_out) == (["b"], {"again": "the model was learned from it"})
    assert (alone.outcome, alone.windows) == ("cannot be judged", 0)
    assert "training_runs" in alone.reason
    assert lenient.runs == ["again", "b"]
    assert lenient.requirement.endswith("training runs of the model count")
    assert lenient.flags == ["Training runs of the model count, as the criterion states."]
    assert [f["name"] for f in v.content.learned_from] == ["a"]


@pytest.mark.slow
def test_a_diagnosis_does_not_judge_itself(comparison):
    """Its training runs are marked by what they were used for."""
    from diagnosis.acceptance.record.validation import _JudgedRuns

    used = [
        replace(e, learned=e.model, use=use)
        for e, use in zip(comparison.evaluations, ("train", "test", "test"), strict=True)
    ]
    found = _JudgedRuns(replace(comparison, evaluations=used), None, None, [])
    learned = {p.name for p in found.predicted(4.0) if p.learned}
    assert learned == {"a", "again"}, "the second is the first"


def test_what_decides_is_hashed_and_a_change_since_is_refused(folder, tmp_path):
    data = tmp_path / "a.csv"
    data.write_bytes((folder / "a.csv").read_bytes())
    model = tmp_path / "model.ssv"
    write_model(model, Model({"X_u": -1.0}))
    c = diagnosis.compare(data, model=model)
    roles = {f["role"]: f["path"] for f in files_of(c, {})}
    assert roles == {"data": str(data), "model": str(model)}
    write_model(model, Model({"X_u": -2.0}))
    with pytest.raises(InputError, match=r"model\.ssv' has changed since the comparison"):
        validated(c, tmp_path, {})
    write_model(model, Model({"X_u": -1.0}))
    other = tmp_path / "other.ssv"
    write_model(other, Model({"X_u": -3.0}))
    with pytest.raises(InputError, match=r"other\.ssv' is not the model that was compared"):
        files_of(c, {"model": other})
    data.write_bytes(data.read_bytes() + b"\n")
    with pytest.raises(InputError, match=r"a\.csv' has changed since"):
        validated(c, tmp_path, {})


def test_further_files_are_hashed_once_whether_one_or_several(monkeypatch, tmp_path):
    paths = [tmp_path / name for name in ("a.py", "b.py", "criteria.json")]
    for path in paths:
        path.write_text(path.name)
    monkeypatch.setattr("diagnosis.acceptance.record.provenance._model", lambda _: [])
    further = {"effects": [*paths[:2], tmp_path / "installed"], "ship": None, "criteria": str(paths[2])}
    found = files_of(SimpleNamespace(evaluations=[]), further | {"again": paths[0]})
    assert [(f["role"], f["path"]) for f in found] == [
        ("effects", str(paths[0])), ("effects", str(paths[1])), ("criteria", str(paths[2])),
    ]  # fmt: skip
    assert [f["sha256"] for f in found] == [sha256(p.name.encode()).hexdigest() for p in paths]
    with pytest.raises(InputError, match="missing"):
        files_of(SimpleNamespace(evaluations=[]), {"criteria": tmp_path / "missing"})


@pytest.mark.slow
def test_parameters_in_memory_are_told_by_their_numbers(folder, comparison, tmp_path):
    hashes = set()
    for value in (-1.0, -2.0):
        c = diagnosis.compare(folder / "b.csv", model=Model({"X_u": value}))
        v = validated(c, tmp_path, {})
        assert v.content.model == "parameters that are not a file"
        hashes.add(v.content.hashes.parameters)
    assert len(hashes) == 2
    with pytest.raises(InputError, match="is not the model that was compared"):
        files_of(comparison, {"model": folder / "a.csv"})


def test_code_and_confinement_are_told(comparison, tmp_path):
    content = validated(comparison, tmp_path, {}).content
    assert len(content.code.sha256) == 64
    assert content.code.libraries["numpy"] == np.__version__
    assert content.confinement.startswith("none needed")


@pytest.mark.slow
def test_effects_of_a_user_are_code_that_nothing_confines(folder, tmp_path):
    """It runs in this process, where it may read the run and play it back."""
    (tmp_path / "own.py").write_text(LINEAR)
    craft = ship_with([tmp_path / "own.py"])
    c = diagnosis.compare(folder / "a.csv", model=DescribedShip(Model(ship=craft)))
    content = validated(c, tmp_path, {"tolerance": 50.0}).content
    assert content.confinement.startswith("unconfined: effects of the user")
    (j,) = content.judgements
    assert j.outcome == "met"
    assert any("may have read the measurement" in flag for flag in j.flags)


def test_falsified_data_next_to_an_original_does_not_hold(folder, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    data = csv_of(sail(48.0, h=0.1)[0], tmp_path / "run.csv")
    v = validated(diagnosis.compare("run.csv"), tmp_path, {})
    v.write(tmp_path / "out")
    usual = [str(tmp_path / "out" / FILES[0]), "--allow-missing", "signature"]
    assert verify_main(usual) == 0
    original = data.read_bytes()
    (tmp_path / "elsewhere").mkdir()
    monkeypatch.chdir(tmp_path / "elsewhere")
    assert verify_main(usual) == 0
    data.write_bytes(original.replace(b"0", b"1", 1))
    assert verify_main(usual) == 1
    data.write_bytes(original)
    monkeypatch.chdir(tmp_path)
    copy = tmp_path / "out" / "run.csv"
    copy.write_bytes(original.replace(b"0", b"1", 1))
    assert verify_main(usual) == 1
    copy.write_bytes(original)
    data.write_bytes(original.replace(b"0", b"1", 1))
    assert verify_main(usual) == 1


@pytest.mark.slow
def test_another_code_is_not_checked(comparison, folder, tmp_path):
    validated(comparison, tmp_path, {}).write(tmp_path / "out")
    record = tmp_path / "out" / FILES[0]
    content = json.loads(record.read_text())
    content["code"]["sha256"] = "0" * 64
    record.write_text(json.dumps(content))
    usual = [str(record), "--allow-missing", "signature"]
    assert verify_main(usual) == 4
    assert verify_main([*usual, "--allow-missing", "code"]) == 0


def faked(comparison, **changes):
    p = Predictions(comparison.evaluations[0], 4.0)
    made = object.__new__(Predictions)
    made.__dict__ = {**p.__dict__, **changes}
    return made


def test_e_is_simulation_minus_data(comparison):
    """A prediction that is ahead of the measurement by 0.1 m and turned by 0.02 rad to starboard."""
    p = Predictions(comparison.evaluations[0], 4.0)
    psi = p.measured[:, 2]
    shift = np.zeros_like(p.measured)
    shift[:, :3] = np.column_stack([0.1 * np.cos(psi), 0.1 * np.sin(psi), np.full(psi.size, 0.02)])
    ahead = faked(comparison, motion=p.measured + shift)
    predicted = [Predicted("a", ahead, sources_of(p, None), {})]
    heading = {**EASY, "quantity": "heading", "unit": "deg", "tolerance": 5.0}
    j = judge(Criterion(**heading), ["a"], predicted)
    assert j.found is not None
    assert j.found.errors == pytest.approx(0.02)
    found = judge(Criterion(**EASY), ["a"], predicted).found
    assert found is not None
    assert found.offset == pytest.approx([0.1, 0.0])


def test_an_error_far_below_that_of_the_measurement_is_flagged(comparison):
    """As of an FMU that plays back what was measured."""
    p = Predictions(comparison.evaluations[0], 4.0)
    sources = sources_of(p, None)
    for given, flags in ((p.measured + 1e-9, 2), (p.motion, 0)):
        found = judge(
            Criterion(**EASY), ["a"], [Predicted("a", faked(comparison, motion=given), sources, {})]
        )
        assert len(found.flags) == flags
    assert (
        "far below the uncertainty"
        in judge(
            Criterion(**EASY), ["a"], [Predicted("a", faked(comparison, motion=p.measured), sources, {})]
        ).flags[0]
    )


def stepped(comparison, order, size, parametric=False):
    """Predictions whose error is size h^order; of order None they do not follow the step."""
    base = np.tile([10.0, 5.0, 1.0, 0.2, 0.1, 0.05], (7, 1))

    def finer(parts):
        return base + (0.0 if order is None else size * parts**-order)

    smoothed = SimpleNamespace(eta=np.zeros((7, 3)))
    predictor = SimpleNamespace(parametric=parametric, name="box")
    return SimpleNamespace(
        finer=finer, smoothed=smoothed, first=np.arange(7), predictor=predictor
    ), finer(1)


@pytest.mark.parametrize("order", [1, 2, 4])
def test_u_num_is_the_error_itself_where_steps_converge(comparison, order):
    """Of an explicit Euler method halving shows half the error alone."""
    found = _numerical(*stepped(comparison, order, 0.01))
    assert np.sqrt(found["heading"]) == pytest.approx(0.01)
    assert np.sqrt(found["position"]) == pytest.approx(0.01 * np.sqrt(2.0))


def test_u_num_is_not_known_where_steps_do_not_act(comparison):
    for order in (None, -1.0, 0.1):
        with pytest.raises(InputError, match="the predictions of box do not converge"):
            _numerical(*stepped(comparison, order, 0.01))
    assert _numerical(*stepped(comparison, None, 0.0, parametric=True))["u"] == pytest.approx(0.0)


def test_current_and_wind_are_inputs_where_they_are_known(comparison):
    p = Predictions(comparison.evaluations[0], 4.0)
    assert isinstance(sources_of(p, None)["current"], str)
    one, two = (sources_of(p, None, InputStd(current=k * 0.01, wind=0.0)) for k in (1.0, 2.0))
    assert np.sqrt(two["current"]["position"]) == pytest.approx(
        2.0 * np.sqrt(one["current"]["position"]), rel=0.1
    )
    # Still water carries a ship that follows it by less than the current goes.
    assert 0.0 < np.sqrt(one["current"]["position"]).mean() < np.sqrt(2.0) * 0.01 * 4.0
    assert one["wind"]["position"] == pytest.approx(0.0)


def test_met_says_what_is_not_known(comparison, tmp_path):
    j = validated(comparison, tmp_path, {}, input_std={"current": 0.0}).content.judgements[0]
    assert j.outcome == "met"
    assert j.reason.endswith("u_val leaves out what is not known: parameters, process noise, wind")
    assert j.k_u_val == pytest.approx(2.0 * j.budget.u_val)


def test_times_are_local_with_their_offset(monkeypatch):
    monkeypatch.setenv("TZ", "Asia/Kathmandu")
    time.tzset()
    try:
        assert now().endswith("+05:45")
        assert abs(datetime.fromisoformat(now()).timestamp() - time.time()) < 5.0
    finally:
        monkeypatch.undo()
        time.tzset()


def test_the_pdf_is_fit_for_a_client(comparison, tmp_path):
    stated = {"client": "Yard & Sons <Ltd>", "assessor": "A. Sessor", "document": "CY-42"}
    validated(comparison, tmp_path, {"name": "close enough"}, particulars=stated).write(tmp_path / "out")
    pages = [page.extract_text() for page in pypdf.PdfReader(tmp_path / "out" / FILES[2]).pages]
    first = " ".join(pages[0].split())
    for text in (*stated.values(), "nominal model", "cse1", "close enough", "met", "not given", "u_val"):
        assert text in first
    for k, page in enumerate(pages, 1):
        assert f"page {k} of {len(pages)}" in page
        assert "Validation record · document CY-42" in page
    every = " ".join(pages)
    assert "Figure 1. close enough: error E = S − D" in every
    assert "Figure 2. a: measured track" in every
    shown = (tmp_path / "out" / FILES[1]).read_text()
    assert "Judged model and data" in shown
    assert "the same motion as a" in shown


def test_a_predictor_of_a_user_is_named_by_its_code(comparison, tmp_path):
    """Also one that derives from a class of this project, and would else pass for it."""

    class Mine(DescribedShip):
        pass

    changed = replace(comparison, predictor=Mine(Model()))
    assert __file__ in [f["path"] for f in files_of(changed, {}) if f["role"] == "model"]
    content = validated(changed, tmp_path, {}).content
    assert (content.model, content.confinement) == ("Mine, a class of the user", "unconfined")


def test_cuts_of_one_log_that_overlap_count_once(folder, tmp_path):
    run = sail(64.0, h=0.1)[0]
    for name, begin, end in (("first", 0.0, 40.0), ("last", 30.0, 64.0)):
        csv_of(run.rows((run.time >= begin) & (run.time < end)), tmp_path / f"{name}.csv")
    c = diagnosis.compare([tmp_path / "first.csv", tmp_path / "last.csv"])
    assert validated(c, tmp_path, {}).content.judgements[0].runs == ["first"]


def test_a_side_car_that_changed_since_is_refused(folder, tmp_path):
    data = tmp_path / "a.csv"
    data.write_bytes((folder / "a.csv").read_bytes())
    beside = tmp_path / "a.csv.json"
    beside.write_text("{}")
    c = diagnosis.compare(data)
    assert [f["role"] for f in files_of(c, {})] == ["data", "layout of data"]
    beside.write_text('{"trial": null}')
    with pytest.raises(InputError, match=r"a\.csv\.json' has changed since"):
        files_of(c, {})


@pytest.mark.slow
def test_samples_that_are_well_before_the_horizon_are_said(folder, tmp_path):
    """At 1 Hz the last sample of a window of 4 s is at 3 s, where the error is smaller."""
    run = sail(48.0, h=0.1)[0]
    rare = replace(run, time=run.time[::10], pose=run.pose[::10], tau_cmd=run.tau_cmd[::10])
    c = diagnosis.compare(csv_of(rare, tmp_path / "rare.csv"))
    early, late = validated(c, tmp_path, {"horizon": 4.0}, {"horizon": 24.0}).content.judgements
    assert any("is 3 s after the start" in flag for flag in early.flags)
    assert not any("Samples are rare" in flag for flag in late.flags)


def test_windows_without_samples_are_counted(folder, tmp_path):
    """Cells that somebody left empty leave a trace."""
    table = pd.read_csv(folder / "b.csv")
    table.loc[(table.time > 20.0) & (table.time < 23.9), ["x", "y", "psi"]] = np.nan
    table.to_csv(tmp_path / "holes.csv", index=False)
    v = validated(diagnosis.compare(tmp_path / "holes.csv"), tmp_path, {})
    (j,) = v.content.judgements
    assert (j.offered, j.windows, j.excluded) == (12, 11, {"too few samples": 1})
    assert v.content.samples[0].dropped > 30


def test_a_posterior_of_another_model_says_nothing():
    p = Posterior(names=["vessel.X_u"], units=["N.s/m"], mean=[-1.0], covariance=[[0.01]])
    learned = Learned(p, ForceDisturbance(np.ones(3), np.ones(3)), ())
    assert learned.is_of(Model({"X_u": -1.0}))
    assert not learned.is_of(Model())
    assert not Learned(p.model_copy(update={"names": ["vessel.other"]}), learned.disturbance, ()).is_of(
        Model()
    )


@pytest.mark.slow
def test_the_inside_of_a_system_is_hashed(tmp_path, monkeypatch):
    """An FMU within a scenario that is replaced, and a model that remembers its runs within one."""
    monkeypatch.chdir(tmp_path)
    build(["vessel"], tmp_path, native=native_targets())
    (tmp_path / "vessel.fmu").rename("inner.fmu")
    system = {"name": "system", "step": 0.05, "stop": 10.0, "fmus": {"ship": {"path": "inner.fmu"}}}
    (tmp_path / "system.json").write_text(json.dumps(system))
    run = sail(24.0, h=0.1)[0]
    csv_of(run, tmp_path / "run.csv")
    c = diagnosis.compare("run.csv", model="system.json")
    v = validated(c, tmp_path, {})
    assert {f.role for f in v.content.files} == {"data", "model", "FMU ship"}
    v.write("out")
    usual = ["out/validation.json", "--allow-missing", "signature"]
    assert verify_main(usual) == 0
    remember(tmp_path / "inner.fmu", (), diagnosis.gather([run]))
    assert verify_main(usual) == 1
    again = diagnosis.Fmu("system.json")
    assert [f.name for f in again.learned_from] == [run.name]
