"""The same ship at another size, in its own units: the diagnosis finds the same, and says the ship's seconds."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from support.measured import sail

import diagnosis
from diagnosis import Model
from diagnosis.assessment.closed_loop import REFERENCES
from diagnosis.assessment.covariates import MIN_TIME_BIN
from diagnosis.assessment.stability import OperatingRegion, largest_distance
from diagnosis.compare import main as compare
from diagnosis.gathering import gather
from diagnosis.model.uncertainty import omega_std
from fmus.declare import variables
from fmus.effects import STANDARD
from fmus.scale import CSE1, REFERENCE_LENGTH, Scale
from fmus.ship import Ship, ship
from fmus.thrusters.thrusters import make as make_thrusters
from fmus.vessel.vessel import make as make_vessel

SIZES = [Scale(length / REFERENCE_LENGTH) for length in (7.0, 320.0)]
HIDDEN = {"ship": {"V_n": 0.05, "V_e": -0.03}, "thrusters": {"deadband": 0.08}}


def of_size(scale):
    """The nominal model of a ship that is CyberShip Enterprise 1 at another size."""
    effects = STANDARD.at(scale)
    added = {p.name for e in effects.values() for p in e.parameters}

    def grown(component):
        own = (v for v in variables(component.params) if v.name not in added)
        return {v.name: scale.factor(v.unit) * v.start for v in own}

    craft = Ship(effects, make_vessel(effects), make_thrusters(effects), scale=scale)
    return Model(grown(ship().vessel), grown(ship().thrusters), ship=craft)


def at_size(run, scale):
    """What is measured of the same manoeuvre of a ship of another size."""
    pose = run.pose * [scale.length, scale.length, 1.0]
    return replace(run, time=scale.time * run.time, pose=pose, tau_cmd=run.tau_cmd * scale.forces)


@cache
def loaded(scale, seconds=64.0):
    """The runs of a ship of a size that lacks something, one to learn from and one to test on."""
    each = [(seconds, "a", 1), (48.0, "b", 2)]
    runs = [replace(sail(t, **HIDDEN, seed=k)[0], name=name) for t, name, k in each]
    return gather([at_size(run, scale) for run in runs], model=of_size(scale))


@cache
def learned(scale):
    train, test = loaded(scale)
    return diagnosis.diagnose([train], [test], model=of_size(scale))


@pytest.mark.parametrize("scale", SIZES, ids=["7 m", "320 m"])
def test_motion_model_error_and_predictions_are_the_same_in_own_units(scale):
    def in_own_units(scale):
        (w, _), model = loaded(scale), of_size(scale)
        s, errors = w.smoothed, diagnosis.Windows([w.smoothed]).errors(model)
        pose = np.array([scale.length, scale.length, 1.0])
        yield "eta", s.eta / pose
        yield "nu", s.nu / scale.speeds
        yield "noise", s.noise / pose
        yield "middle", w.middle / scale.time
        yield "omega", diagnosis.omega(w, model) / scale.forces
        yield "uncertainty", omega_std(w, model) / scale.forces
        yield "position", errors.position / scale.length
        yield "heading", errors.heading

    for (name, same), (_, other) in zip(in_own_units(CSE1), in_own_units(scale), strict=True):
        assert np.array_equal(np.isnan(same), np.isnan(other)), name
        np.testing.assert_allclose(other, same, rtol=1e-6, atol=1e-6 * np.nanmax(same), err_msg=name)


@pytest.mark.slow
@pytest.mark.parametrize("scale", SIZES, ids=["7 m", "320 m"])
def test_the_same_is_found_in_own_units(scale):
    same, other = learned(CSE1), learned(scale)
    assert other.verdict == same.verdict == "found"
    assert [f.id for f in other.learned.effects] == [f.id for f in same.learned.effects]
    assert {f.id for f in same.learned.effects} == {"deadband", "current"}
    model, posterior = of_size(scale), other.posterior
    unit = np.array([model.unit(name.partition(".")[2]) for name in posterior.names])
    assert posterior.names == same.posterior.names
    std = np.sqrt(np.diag(same.posterior.covariance))
    np.testing.assert_allclose(
        posterior.mean / unit, same.posterior.mean, rtol=1e-3, atol=1e-2 * std.min()
    )
    np.testing.assert_allclose(np.sqrt(np.diag(posterior.covariance)) / unit, std, rtol=1e-2)
    np.testing.assert_allclose(
        other.unrecorded.push.size / scale.forces, same.unrecorded.push.size, rtol=1e-2
    )
    np.testing.assert_allclose(other.unrecorded.push.time / scale.time, same.unrecorded.push.time)
    rate = scale.factor("1/s")
    assert other.stability.bounded == same.stability.bounded
    assert other.stability.learned_min_dissipation / rate == pytest.approx(
        same.stability.learned_min_dissipation, rel=1e-3
    )


@pytest.mark.slow
@pytest.mark.parametrize("scale", SIZES, ids=["7 m", "320 m"])
def test_texts_say_the_seconds_of_the_ship(scale, tmp_path):
    found = learned(scale)
    seconds = f"{8.0 * scale.time:.3g} s"
    assert f"predictions over {seconds} miss" in repr(found)
    assert f"over {seconds} [mm]" in found._repr_html_()
    page = found.write_report(tmp_path / "report.html").read_text(encoding="utf-8")
    for text in (
        f"within windows of {seconds}",
        f"error of {seconds} predictions",
        f"of ω: {3.0 * scale.time:.3g} s",
    ):
        assert text in page
    assert " 8 s" not in page


@pytest.mark.parametrize("scale", SIZES, ids=["7 m", "320 m"])
def test_effects_begin_end_and_are_tried_at_the_size_of_the_ship(scale):
    grown = STANDARD.at(scale)
    assert list(grown) == list(STANDARD)
    for e in STANDARD.values():
        for p, q in zip(e.parameters, grown[e.id].parameters, strict=True):
            factor = scale.factor(p.unit)
            assert q.start == factor * p.start
            for side in ("min", "max"):
                end = getattr(p.range, side)
                assert getattr(q.range, side) == (None if end is None else factor * end)
    nominal = ship().parameters
    values = {v.name: v.start for part in nominal.values() for v in part.values()}
    larger = of_size(scale)
    for e in STANDARD.values():
        units = {p.name: scale.factor(p.unit) for p in e.parameters}
        for own, other in zip(
            e.search.values(values), grown[e.id].search.values(larger.values), strict=True
        ):
            assert other == pytest.approx({name: units[name] * x for name, x in own.items()})


@pytest.mark.parametrize("scale", SIZES, ids=["7 m", "320 m"])
def test_closed_loops_are_similar(scale):
    reference = REFERENCES[0]._replace(seconds=60.0)
    same, other = largest_distance(reference, Model()), largest_distance(reference, of_size(scale))
    assert other / scale.length == pytest.approx(same, rel=1e-6)


def test_the_least_region_is_that_of_the_size():
    slow = OperatingRegion.of(np.full((3, 3), np.nan), SIZES[0])
    assert slow == pytest.approx(0.1 * np.array(OperatingRegion()) * SIZES[0].speeds)


def test_profiles_over_time_have_bins_of_the_size():
    from diagnosis.assessment.covariates import covariates_by_axis

    for scale in (CSE1, SIZES[0]):
        time = covariates_by_axis(loaded(scale))[0][-2]
        assert np.diff(time.edges).min() >= MIN_TIME_BIN * scale.time


def test_another_horizon(tmp_path):
    run = sail(40.0)[0]
    table = np.column_stack([run.time, run.pose, run.tau_cmd])
    np.savetxt(
        tmp_path / "a.csv", table, delimiter=",", comments="", header="time,x,y,psi,tau_X,tau_Y,tau_N"
    )
    for horizon in ("0", "nan", "-8"):
        assert (
            compare([str(tmp_path / "a.csv"), "--horizon", horizon, "--out", str(tmp_path / "no")]) == 2
        )
    short, long = gather([run], horizon=4.0)[0], gather([run], horizon=10.0)[0]
    errors = [diagnosis.evaluate([w]).evaluations[0].before.errors for w in (short, long)]
    assert [e.run.size for e in errors] == [10, 4]
    assert errors[0].over_all()[0] < errors[1].over_all()[0]
