"""The same ship at another size, in its own units: the diagnosis finds the same, and says the ship's seconds."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from support.measured import csv_of, sail

import diagnosis
from diagnosis import Model
from diagnosis.assessment.closed_loop import REFERENCES
from diagnosis.assessment.gathering import gather
from diagnosis.assessment.stability import OperatingRegion, largest_distance
from diagnosis.compare import main as compare
from diagnosis.predictors.uncertainty import omega_std
from diagnosis.predictors.weak_form import BLOCK
from fmus.actuators.law import Law
from fmus.declare import variables
from fmus.effects import STANDARD
from fmus.scale import REFERENCE, REFERENCE_LENGTH, Scale
from fmus.ship import ship
from fmus.ships.ship_file import read_ship, shipped_ships
from fmus.ships.wind import described_numbers

SIZES = [Scale(length / REFERENCE_LENGTH) for length in (7.0, 320.0)]
HIDDEN = {"ship": {"V_n": 0.05, "V_e": -0.03}, "thrusters": {"lag": 0.6}}


def grown(d, scale):
    """A description with every number at another size."""
    units = {n: v.unit for n, v in ship(STANDARD, d).parameters["vessel"].items()}
    always = {"x": "m", "y": "m", "half_spacing": "m", "lag": "s"}

    wind = {v.name: v.unit for v in described_numbers([v.name for v in d.wind])}

    def given(values, units):
        return tuple(v._replace(value=scale.factor(units[v.name]) * v.value) for v in values)

    def actuator(part):
        law = Law.known[part.law]
        declared = {v.name: v.unit for v in variables(law.Parameters)}
        rates = {f"{c.name}_rate": f"{c.unit}/s".replace("s/s", "s2") for c in law.commands}
        return part._replace(values=given(part.values, always | rates | declared))

    length = scale.length
    return d._replace(
        length=length * d.length,
        beam=length * d.beam,
        outline=tuple((length * x, length * y) for x, y in d.outline),
        inertia=given(d.inertia, units),
        terms=given(d.terms, units),
        functions=tuple(f._replace(values=given(f.values, units)) for f in d.functions),
        actuators=tuple(map(actuator, d.actuators)),
        wind=given(d.wind, wind),
    )


@cache
def of_size(scale):
    """The nominal model of a ship that is CyberShip Enterprise 1 at another size."""
    return Model(ship=ship(STANDARD, grown(read_ship("cse1"), scale)))


def at_size(run, scale):
    """What is measured of the same manoeuvre of a ship of another size."""
    pose = run.pose * [scale.length, scale.length, 1.0]
    return replace(run, time=scale.time * run.time, pose=pose, tau_cmd=run.tau_cmd * scale.forces)


@cache
def loaded(scale, seconds=48.0):
    """The runs of a ship of a size that lacks something, one to learn from and one to test on."""
    each = [(seconds, "a", 1), (24.0, "b", 2)]
    runs = [replace(sail(t, 0.1, **HIDDEN, seed=k)[0], name=name) for t, name, k in each]
    return gather([at_size(run, scale) for run in runs], model=of_size(scale))


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

    for (name, same), (_, other) in zip(in_own_units(REFERENCE), in_own_units(scale), strict=True):
        assert np.array_equal(np.isnan(same), np.isnan(other)), name
        np.testing.assert_allclose(other, same, rtol=1e-6, atol=1e-6 * np.nanmax(same), err_msg=name)


@pytest.mark.slow
def test_the_same_is_found_in_own_units_and_texts_say_the_seconds_of_the_ship(tmp_path):
    scale = SIZES[-1]
    same, other = learned(REFERENCE), learned(scale)
    assert other.verdict == same.verdict == "found"
    assert [f.id for f in other.learned.effects] == [f.id for f in same.learned.effects]
    assert {f.id for f in same.learned.effects} == {"lag", "current"}
    model, posterior = of_size(scale), other.posterior
    unit = np.array([model.unit(name.partition(".")[2]) for name in posterior.names])
    assert posterior.names == same.posterior.names
    std = np.sqrt(np.diag(same.posterior.covariance))
    np.testing.assert_allclose(
        posterior.mean / unit, same.posterior.mean, rtol=1e-3, atol=1e-2 * std.min()
    )
    np.testing.assert_allclose(np.sqrt(np.diag(posterior.covariance)) / unit, std, rtol=1e-2)
    np.testing.assert_allclose(
        other.unrecorded.disturbance.size / scale.forces, same.unrecorded.disturbance.size, rtol=1e-2
    )
    np.testing.assert_allclose(
        other.unrecorded.disturbance.time / scale.time, same.unrecorded.disturbance.time
    )
    rate = scale.factor("1/s")
    assert other.stability.bounded == same.stability.bounded
    assert other.stability.learned_min_dissipation / rate == pytest.approx(
        same.stability.learned_min_dissipation, rel=1e-3
    )
    seconds = f"{8.0 * scale.time:.3g} s"
    assert f"prediction error over {seconds}" in repr(other)
    assert f"over {seconds} [mm]" in other._repr_html_()
    page = other.write_report(tmp_path / "report.html").read_text(encoding="utf-8")
    for text in (
        f"in windows of {seconds}",
        f"error of {seconds} predictions",
        f"of ω: {3.0 * scale.time:.3g} s",
    ):
        assert text in page
    assert " 8 s" not in page


@pytest.mark.parametrize("scale", SIZES, ids=["7 m", "320 m"])
@pytest.mark.parametrize("name", shipped_ships())
def test_effects_begin_end_and_are_tried_at_the_size_of_the_ship(scale, name):
    described = read_ship(name)
    same, other = ship(STANDARD, described), ship(STANDARD, grown(described, scale))
    of_same, of_other = (Model(ship=each).values for each in (same, other))
    assert list(same.effects) == list(other.effects)
    for e, larger in zip(same.effects.values(), other.effects.values(), strict=True):
        units = {p.name: scale.factor(p.unit) for p in e.parameters}
        for p, q in zip(e.parameters, larger.parameters, strict=True):
            assert q.start == pytest.approx(units[p.name] * p.start)
            for end, moved in ((p.range.min, q.range.min), (p.range.max, q.range.max)):
                assert moved == (None if end is None else pytest.approx(units[p.name] * end))
        pairs = zip(e.search.values(of_same), larger.search.values(of_other), strict=True)
        for tried, then in pairs:
            assert then == pytest.approx({n: units[n] * x for n, x in tried.items()})


@pytest.mark.parametrize("scale", SIZES, ids=["7 m", "320 m"])
def test_closed_loops_are_similar(scale):
    reference = REFERENCES[0]._replace(seconds=60.0)
    same, other = (largest_distance(reference, of_size(each)) for each in (REFERENCE, scale))
    assert other / scale.length == pytest.approx(same, rel=1e-6)


def test_the_least_region_is_that_of_the_size():
    slow = OperatingRegion.of(np.full((3, 3), np.nan), SIZES[0])
    assert slow.edges == pytest.approx(0.1 * OperatingRegion().edges * SIZES[0].speeds)


@pytest.mark.slow
def test_profiles_over_time_have_bins_of_the_size():
    from diagnosis.assessment.covariates import covariates_by_axis

    scale = SIZES[0]
    time = covariates_by_axis(loaded(scale))[0][-2]
    assert np.diff(time.edges).min() >= BLOCK * scale.time


def test_another_horizon(tmp_path):
    run = sail(40.0)[0]
    csv_of(run, tmp_path / "a.csv")
    for horizon in ("0", "nan", "-8"):
        assert (
            compare([str(tmp_path / "a.csv"), "--horizon", horizon, "--out", str(tmp_path / "no")]) == 2
        )
    short, long = gather([run], horizon=4.0)[0], gather([run], horizon=10.0)[0]
    errors = [diagnosis.evaluate([w]).evaluations[0].before.errors for w in (short, long)]
    assert [e.run.size for e in errors] == [10, 4]
    assert errors[0].over_all()[0] < errors[1].over_all()[0]
