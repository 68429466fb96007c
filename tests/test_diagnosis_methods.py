"""The seam of identification methods: what each guarantees, the command's option, a library that is missing."""

import json
import subprocess
import sys
from importlib.util import find_spec

import numpy as np
import pytest
from support.measured import csv_of, sail, smoothed
from support.project import ROOT

import diagnosis
from cosim import InputError
from diagnosis import Model, omega
from diagnosis.learn import main
from diagnosis.search import DEFAULT, METHODS

needs_peers = pytest.mark.skipif(
    find_spec("sklearn") is None or find_spec("pysindy") is None, reason="needs the extra 'hidden'"
)
PEERS = ("pls", "sindy")
HIDDEN = {
    "loss_yaw": {"thrusters": {"loss_yaw": 0.3}},
    "N_r": {"ship": {"delta_N_r": -1.0}},
}


def windows(noise, seed=1, **hidden):
    run, _ = sail(160.0, h=0.05, noise=noise, seed=seed, **hidden)
    return diagnosis.weak_windows(smoothed(run))


@pytest.fixture(scope="module")
def runs():
    """Effect -> a run without noise in which it is hidden."""
    return {effect: [windows(0.0, **hidden)] for effect, hidden in HIDDEN.items()}


def fitted(name, runs, model=None):
    stages = []
    return diagnosis.method(name).fit(runs, model or Model(), 0.1, stages.append, 0), stages


def value(effect):
    return next((n, x) for part in HIDDEN[effect].values() for n, x in part.items())


@needs_peers
@pytest.mark.parametrize(
    ("name", "effect"),
    [("pls", "loss_yaw"), ("sindy", "N_r")],
)
def test_hidden_linear_effect_is_found_first_with_its_value(name, effect, runs):
    found, stages = fitted(name, runs[effect])
    first = found.effects[0]
    parameter, true = value(effect)
    assert first.id == found.ranking[0].id == effect
    assert first.values[parameter] == pytest.approx(true, rel=0.03)
    assert first.q2 > 0.99
    assert stages


@needs_peers
@pytest.mark.parametrize("name", PEERS)
def test_findings_keep_the_guarantees_of_the_interface(name, runs):
    """As the docstring of ``Method`` states them."""
    start = Model(vessel={"delta_X_u": -0.5})
    given = runs["loss_yaw"]
    before = omega(given[0], start)
    found, _ = fitted(name, given, start)
    again, _ = fitted(name, given, start)
    ids = [f.id for f in found.effects]
    assert len(set(ids)) == len(ids)
    assert set(ids) <= set(start.ship.effects)
    assert [dict(f.values) for f in again.effects] == [dict(f.values) for f in found.effects]
    at = start
    for f in found.effects:
        at = at.plus(f.values)
        assert f.model.values == at.values
        assert np.isnan(f.confidence)
        assert list(f.alike) == []
    assert found.model.values == at.values
    assert np.array_equal(omega(given[0], start), before)
    explained = sum(f.share for f in found.effects)
    assert explained == pytest.approx(found.effects[-1].q2)


@needs_peers
@pytest.mark.parametrize("name", PEERS)
def test_ranking_has_every_candidate_once(name, runs):
    found, _ = fitted(name, runs["N_r"])
    ids = [r.id for r in found.ranking]
    assert len(set(ids)) == len(ids) > 30
    scores = [r.score for r in found.ranking]
    assert scores == sorted(scores)
    q2 = {r.id: r.q2 for r in found.ranking}
    assert q2["N_r"] > 0.99 > q2["X_u"]


def test_unknown_method_names_the_nearest():
    with pytest.raises(InputError, match="no method 'sindi'; did you mean 'sindy'"):
        diagnosis.method("sindi")


@pytest.mark.parametrize(("name", "library"), [("pls", "sklearn"), ("sindy", "pysindy")])
def test_missing_library_is_named_with_the_extra(name, library, monkeypatch):
    if name == "sindy" and find_spec("sklearn") is None:
        pytest.skip("needs scikit-learn")
    for module in [m for m in sys.modules if m.partition(".")[0] == library]:
        monkeypatch.delitem(sys.modules, module)
    monkeypatch.delitem(sys.modules, "diagnosis.search.peers", raising=False)
    monkeypatch.setitem(sys.modules, library, None)
    with pytest.raises(InputError) as raised:
        diagnosis.method(name)
    assert str(raised.value) == f"method '{name}' needs {library}: pip install 'cybership[analysis]'"


def test_default_method_imports_no_library_of_the_others():
    code = (
        "import sys, diagnosis; diagnosis.method(); import diagnosis.learn, diagnosis.session; "
        "print(sorted({m.partition('.')[0] for m in sys.modules} & {'sklearn', 'pysindy'}))"
    )
    ended = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, cwd=ROOT, check=True
    )
    assert ended.stdout.strip() == "[]"
    assert DEFAULT == "selection"
    assert set(METHODS) == {"selection", *PEERS}


@pytest.fixture
def file(tmp_path):
    """A measured run with lost yaw moment as CSV."""
    run, _ = sail(96.0, h=0.05, thrusters={"loss_yaw": 0.3})
    return csv_of(run, tmp_path / "run.csv")


def test_command_refuses_an_unknown_method_before_any_work(tmp_path, capsys):
    out = tmp_path / "out"
    assert main([str(tmp_path / "no.csv"), "--method", "magic", "--out", str(out)]) == 2
    assert "no method 'magic'; there are selection, pls, sindy" in " ".join(
        capsys.readouterr().err.split()
    )
    assert not out.exists()


@needs_peers
@pytest.mark.slow
def test_command_writes_what_another_method_finds(file, tmp_path, capsys):
    out = tmp_path / "out"
    assert main([str(file), "--method", "pls", "--out", str(out)]) == 0
    found = json.loads((out / "diagnosis.json").read_text(encoding="utf-8"))
    assert found["effects"][0]["id"] == "loss_yaw"
    assert found["effects"][0]["confidence"] is None
    assert found["effects"][0]["coefficients"]["loss_yaw"]["value"] == pytest.approx(0.3, rel=0.1)
    assert "loss_yaw" in capsys.readouterr().out
