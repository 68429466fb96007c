"""The fit of an FMU's parameters, its intervals, search and verdict: on predictions in closed form, without an FMU."""

from dataclasses import dataclass, replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import multivariate_normal

from cosim import InputError
from diagnosis.execution.progress import silent
from diagnosis.fmu_parameters import parameter_fit as fits
from diagnosis.fmu_parameters import sensitivity
from diagnosis.fmu_parameters.additional_force import AdditionalForce, EarthDirection
from diagnosis.fmu_parameters.force_search import Accepted, candidates, search
from diagnosis.fmu_parameters.measured_system import Window
from diagnosis.fmu_parameters.parameter_file import CalibratedParameter, Prior
from diagnosis.fmu_parameters.residuals import Setting, WindowResiduals, rms_of
from diagnosis.fmu_parameters.system_calibration import Moved, calibrate, verdict_of
from diagnosis.fmu_parameters.system_remainder import OutputRemainder, SystemRemainder
from diagnosis.predictors.fmu.fmu_playback import PlaybackRequest, PlayedBack

H = 0.1
seeds = st.integers(0, 10**6)


# Predictions that are linear in parameters, in a start value, and in a constant force


@dataclass
class Linear:
    """A system whose output is a sum of curves, each times a value.

    Attributes:
        curves: value -> curve (T,); of an input that of a constant force on it.
        failing: of which values it fails.
    """

    curves: dict
    failing: object = None
    name: str = "linear"
    inputs: tuple = ("f",)
    outputs: tuple = ("y",)

    def run(self, requests):
        return [self._one(r) for r in requests]

    def _one(self, r):
        y = sum(x * self.curves[n] for n, x in r.start.items())
        y = y + sum(t.coefficient * self.curves[self.inputs[t.input]] for t in r.terms)
        if self.failing and self.failing(r.start):
            return PlayedBack(np.full((len(y), 1), np.nan), "it fails")
        return PlayedBack(y[:, None])


def parameter(name, value=2.0, std=0.5, **more):
    return CalibratedParameter(name=name, value=value, prior=Prior(std=std), **more)


def problem(seed, rows=60, noise=0.3, start_std=0.0, far=1.0, **more):
    """Residuals of a linear system, the slopes by z and by the start value, and those at the start (rows,)."""
    rng = np.random.default_rng(seed)
    curves = {n: rng.standard_normal(rows) for n in ("a", "b", "y0", "f")}
    each = [parameter("a", **more), parameter("b", -1.0, 0.2)]
    z = far * rng.standard_normal(2)
    begin = 0.7 + start_std * rng.standard_normal()
    y = sum(p.at(x) * curves[p.name] for p, x in zip(each, z, strict=True)) + begin * curves["y0"]
    y = y + noise * rng.standard_normal(rows)
    w = Window(
        "run",
        0.0,
        PlaybackRequest(H, {"y0": 0.7}, np.zeros((rows - 1, 1))),
        H * np.arange(rows),
        y[:, None],
        {"y0": start_std} if start_std else {},
    )
    r = WindowResiduals(Linear(curves), [w], np.array([noise]), each)
    first = y - sum(p.value * curves[p.name] for p in each) - 0.7 * curves["y0"]
    S = np.column_stack([p.std * curves[p.name] for p in each]) / noise
    return r, S, start_std * curves["y0"] / noise, first / noise


START = Setting((0.0, 0.0))


@settings(max_examples=12)
@given(seeds)
def test_a_fit_is_the_posterior_of_a_linear_model(seed):
    """z ~ N(0, 1), residuals e = e_0 - S z of unit variance; its evidence is the density of e_0."""
    r, S, _, e = problem(seed)
    r.whiten_about(START)
    f = fits.fitted(r, START)
    precision = np.eye(2) + S.T @ S
    mean = np.linalg.solve(precision, S.T @ e)
    assert f.setting.z == pytest.approx(mean, abs=1e-5)
    assert f.covariance == pytest.approx(np.linalg.inv(precision), rel=1e-6)
    assert f.residuals == pytest.approx(e - S @ mean, abs=1e-4)
    assert f.cost == pytest.approx(((e - S @ mean) ** 2).sum() + mean @ mean, rel=1e-8)
    none = fits.fit(r, START, (), [0, 1])
    density = multivariate_normal(cov=np.eye(e.size) + S @ S.T).logpdf
    assert f.log_evidence - 0.5 * e.size * np.log(2.0 * np.pi) == pytest.approx(density(e), rel=1e-6)
    assert none.setting == START
    assert none.data_cost == pytest.approx(e @ e)


@pytest.mark.parametrize(("low", "high"), [(-1.3, 0.4), (-0.2, 2.1)])
def test_a_range_ends_where_the_fmu_begins_to_fail(low, high):
    """Within a 64th of three prior standard deviations, and on the side on which it works."""
    r = problem(0)[0]
    a = r.parameters[0]
    r.processes.failing = lambda start: not a.at(low) < start["a"] < a.at(high)
    found = sensitivity.sensitivities(r, silent).each[0]
    ends = found.parameter
    for end, limit, side in ((ends.min, low, 1.0), (ends.max, high, -1.0)):
        inside = side * (a.z(end) - limit)
        assert 0.0 < inside <= 3.0 / 64.0
    assert found.fault.count("the FMU fails: it fails") == 2


@settings(max_examples=12)
@given(seeds, st.sampled_from([0, 1]))
def test_a_parameter_that_is_held_stays_and_the_other_is_fitted(seed, held):
    r, S, _, e = problem(seed)
    r.whiten_about(START)
    begin = Setting((0.4, -0.3))
    f = fits.fit(r, begin, (), [held])
    s, left = S[:, 1 - held], e - begin.z[held] * S[:, held]
    assert f.setting.z[held] == begin.z[held]
    assert f.setting.z[1 - held] == pytest.approx(s @ left / (1.0 + s @ s), abs=1e-5)


@settings(max_examples=12)
@given(seeds)
def test_an_uncertain_start_is_integrated_out(seed):
    """The same as a fit in which the start value is one more value with its prior."""
    r, S, s, e = problem(seed, start_std=0.4)
    r.whiten_about(START)
    f = fits.fitted(r, START)
    X = np.column_stack([S, s])
    joint = np.eye(3) + X.T @ X
    assert f.setting.z == pytest.approx(np.linalg.solve(joint, X.T @ e)[:2], abs=1e-4)
    assert f.covariance == pytest.approx(np.linalg.inv(joint)[:2, :2], rel=1e-4)
    whole = np.eye(e.size) + np.outer(s, s)
    assert f.data_cost == pytest.approx(
        (e - S @ f.setting.z) @ np.linalg.solve(whole, e - S @ f.setting.z), rel=1e-5
    )


@settings(max_examples=12)
@given(seeds, st.floats(-2.0, 2.0))
def test_a_constant_force_is_fitted_in_any_unit_of_its_coefficient(seed, size):
    """It has no prior: of data without noise it is exact."""
    r, *_ = problem(seed)
    w = r.windows[0]
    truth = w.measured[:, 0] + size * r.processes.curves["f"]
    r.windows = [Window("run", 0.0, w.course, w.time, truth[:, None], {})]
    r.whiten_about(START)
    for unit in (1.0, 0.01):
        setting, sizes = fits.added(fits.fit(r, START), AdditionalForce("f", coefficient=7.0), unit)
        assert sizes == (unit,)
        assert setting.forces[0].coefficient == 0.0
        f = fits.fit(r, setting, sizes)
        X = np.column_stack([r.processes.curves[n] for n in ("a", "b", "f")]) / 0.3 * [0.5, 0.2, 1.0]
        e = (truth - 2.0 * r.processes.curves["a"] + r.processes.curves["b"]) / 0.3
        e -= 0.7 * r.processes.curves["y0"] / 0.3
        best = np.linalg.solve(np.diag([1.0, 1.0, 0.0]) + X.T @ X, X.T @ e)
        assert [*f.setting.z, *f.coefficients] == pytest.approx(best, abs=1e-4)


@settings(max_examples=12)
@given(seeds, st.floats(-0.6, 0.6), st.floats(1.0, 4.0))
def test_a_force_is_accepted_by_the_odds_of_all_candidates_and_none(seed, size, temper):
    """By what each gains with the parameters free: e of the covariance I + S S', and each force without prior."""
    r, S, _, e = problem(seed)
    w, curves = r.windows[0], r.processes.curves
    rng = np.random.default_rng([seed, 1])
    curves |= {n: 0.5 * curves["f"] + s * rng.standard_normal(60) for n, s in (("g", 0.3), ("h", 2.0))}
    curves["twin"], r.processes.inputs = -3.0 * curves["f"], ("f", "g", "h", "twin")
    r.windows = [replace(w, measured=w.measured + size * curves["f"][:, None])]
    r.whiten_about(START)
    possible = [AdditionalForce(n) for n in ("f", "g", "h", "twin")]
    scales = dict.fromkeys(curves, 1.0)
    at = fits.fit(r, START)
    found = search(r, at, [], possible, scales, lambda _: temper, silent)
    W = np.linalg.inv(np.eye(60) + S @ S.T)
    e = e + size * curves["f"] / 0.3
    gain = {n: (curves[n] @ W @ e) ** 2 / (curves[n] @ W @ curves[n]) for n in "fgh"}
    charge = np.log(60) + 2.0 * np.log(4.0)
    score = {n: x / temper - charge for n, x in gain.items() if x > charge / 4.0}
    if max(score.values(), default=0.0) <= 0.0:
        assert found is None
        return
    f, accepted = found
    odds = {n: np.exp(0.5 * x) for n, x in score.items()}
    own = {n: x / (1.0 + sum(odds.values())) for n, x in odds.items()}
    best = max(own, key=own.get)
    first, *alike = (
        name.partition(":")[0].replace("twin", "f") for name in (accepted.force.id, *accepted.alike)
    )
    assert first == best
    assert accepted.probability == pytest.approx(own[best], rel=1e-3)
    assert at.cost - f.cost == pytest.approx(gain[best], rel=1e-3)
    assert accepted.together == pytest.approx(sum(x for x in own.values() if x > 0.05), rel=1e-3)
    like = {n for n, x in own.items() if x > 0.05 and n != best}
    assert {*alike} == like | ({"f"} if best == "f" else set()), "whichever of the twins stands for both"
    assert f.setting.forces == (accepted.force,)
    assert search(r, f, [], [accepted.force], scales, lambda _: temper, silent) is None, "it is there"


@settings(max_examples=12)
@given(seeds, st.floats(1.0, 9.0))
def test_intervals_are_those_of_the_normal_distribution_and_end_at_bounds(seed, inflation):
    r, *_ = problem(seed)
    r.whiten_about(START)
    f = fits.fitted(r, START)
    half = 1.959964 * np.sqrt(inflation * np.diag(f.covariance))
    for p, z, x, (low, high) in zip(
        r.parameters, f.setting.z, half, fits.intervals(r, f, inflation), strict=True
    ):
        assert (low, high) == pytest.approx((p.at(z - x), p.at(z + x)), abs=1e-6)
    a, b = r.parameters
    near = a.at(f.setting.z[0] + 0.3 * half[0])
    r.choose([a.model_copy(update={"max": near}), b])
    (low, high), _ = fits.intervals(r, f, inflation)
    assert high == pytest.approx(near)
    assert low == pytest.approx(a.at(f.setting.z[0] - half[0]), abs=1e-6)


def test_a_value_whose_best_is_beyond_its_bound_ends_there():
    r, *_ = problem(3, far=0.0)
    r.whiten_about(START)
    free = fits.fit(r, START).setting.z[0]
    bound = r.parameters[0].at(free - 0.1)
    r.choose([r.parameters[0].model_copy(update={"value": bound - 0.5, "max": bound}), r.parameters[1]])
    r.whiten_about(START)
    f = fits.fit(r, START)
    assert f.setting.z[0] == pytest.approx(r.parameters[0].bounds[1], abs=1e-3)


class Bent:
    """A prediction that is not linear: y = exp(k) times a curve."""

    name, inputs, outputs = "bent", (), ("y",)

    def __init__(self, rows=20):
        self.curve = np.linspace(0.5, 1.5, rows)

    def run(self, requests):
        return [PlayedBack(np.exp(r.start["k"]) * self.curve[:, None]) for r in requests]


def test_an_interval_of_a_bent_prediction_ends_where_its_cost_does():
    """By the profile: the cost is 1.96^2 above its least at both ends, which are not alike."""
    system, noise = Bent(), 5.0
    w = Window(
        "run", 0.0, PlaybackRequest(H, {}, np.zeros((19, 0))), H * np.arange(20),
        3.0 * system.curve[:, None], {},
    )  # fmt: skip
    p = CalibratedParameter(name="k", value=1.0, prior=Prior(std=3.0))
    r = WindowResiduals(system, [w], np.array([noise]), [p])
    r.whiten_about(Setting((0.0,)))
    f = fits.fit(r, Setting((0.0,)))

    def cost(k):
        z = (k - 1.0) / 3.0
        return (((3.0 - np.exp(k)) * system.curve / noise) ** 2).sum() + z * z

    ((low, high),) = fits.intervals(r, f, 1.0)
    best = p.at(f.setting.z[0])
    assert best == pytest.approx(np.log(3.0), abs=0.1)
    assert [cost(low) - cost(best), cost(high) - cost(best)] == pytest.approx([3.84, 3.84], rel=0.05)
    assert best - low > 1.3 * (high - best)


def test_where_one_side_of_a_value_fails_its_slope_is_that_of_the_other():
    r, S, *_ = problem(1)
    r.whiten_about(START)
    exact, faults = r.slopes(START, ())
    assert exact == pytest.approx(-S, abs=1e-6)
    assert faults == []
    r.processes.failing = lambda start: start["a"] > 2.0
    r.choose(r.parameters)
    one, faults = r.slopes(START, ())
    assert (one, faults) == (pytest.approx(-S, abs=1e-6), [])
    r.processes.failing = lambda start: start["a"] != 2.0
    r.choose(r.parameters)
    none, faults = r.slopes(START, ())
    assert not none[:, 0].any()
    assert none[:, 1] == pytest.approx(-S[:, 1], abs=1e-6)
    assert faults == ["a: the FMU fails on both sides of its value"]
    assert r.failures.startswith("The FMU fails with ")
    assert r.failures.endswith("it fails")
    r.processes.failing = lambda start: True
    with pytest.raises(InputError, match="'linear' fails on run 'run': it fails"):
        r.whiten_about(START)


@settings(max_examples=12)
@given(seeds)
def test_errors_are_those_of_the_samples_in_the_unit_of_the_output(seed):
    rng = np.random.default_rng(seed)
    each, raws = [], []
    for name, rows in (("one", 5), ("two", 4), ("one", 3)):
        e = rng.standard_normal((rows, 2))
        measured = np.where(rng.random((rows, 2)) < 0.3, np.nan, e)
        each.append(Window(name, 0.0, None, np.arange(rows), measured, {}))
        raws.append(np.where(np.isfinite(measured), e / [0.1, 2.0], 0.0).ravel())
    r = WindowResiduals(None, each, np.array([0.1, 2.0]), [])
    found = rms_of(r, np.concatenate(raws), ["x", "y"])
    assert [*found] == ["one", "two"]
    for name, errors in found.items():
        known = np.concatenate([w.measured for w in each if w.run == name])
        for k, output in enumerate(("x", "y")):
            own = known[np.isfinite(known[:, k]), k]
            assert errors[output] == pytest.approx(np.sqrt(np.mean(own**2)) if own.size else 0.0)
    assert r.samples == sum(np.isfinite(w.measured).sum() for w in each)


# An oscillator, by its equations


class Oscillator:
    """m x'' = f - c x - d x', with terms on f as an FMU gets them."""

    name, inputs, outputs = "oscillator", ("f",), ("x", "v")

    def run(self, requests):
        return [self._one(r) for r in requests]

    def _one(self, r):
        x, v, before = 0.0, 0.0, (0.0, 0.0)
        m, c, d = (r.start.get(n, usual) for n, usual in (("m", 2.0), ("c", 10.0), ("d", 1.0)))
        if m <= 0.0 or c > 40.0:
            return PlayedBack(np.full((len(r.inputs) + 1, 2), np.nan), "unstable")
        found = [(x, v)]
        for f in r.inputs[:, 0]:
            for t in r.terms:
                now = (x, v)[t.output]
                y = (now - before[t.output]) / r.h if t.rate else now
                f = f + t.coefficient * (y * abs(y) ** (t.power - 1) if t.power else 1.0)
            before = (x, v)
            v += r.h * (f - c * x - d * v) / m
            x += r.h * v
            found.append((x, v))
        return PlayedBack(np.array(found))


NOISE = 1e-3
DRAG = AdditionalForce("f", "v", 2, coefficient=-3.0)


def runs(count, values, forces, first=0, steps=300):
    """Windows of measured runs of an oscillator with other values and a further force."""
    found = []
    for k in range(first, first + count):
        rng, t = np.random.default_rng(k), H * np.arange(steps + 1)
        force = 2.0 * np.sin(0.7 * t + k) + 1.5 * rng.uniform(-1.0, 1.0, t.size)[(t / 3.0).astype(int)]
        terms = [t for f in forces for t in f.terms(("f",), ("x", "v"))]
        asked = PlaybackRequest(H, values, force[:-1, None], terms)
        x = Oscillator().run([asked])[0].outputs[:, :1] + NOISE * rng.standard_normal((steps + 1, 1))
        found.append(Window(f"run{k}", 0.0, PlaybackRequest(H, {}, force[:-1, None]), t, x, {}))
    return found


def judged(values=(), forces=(), validate=None, possible=True):
    """The calibration of mass, spring and damper on two runs, with one to test on."""
    each = [parameter("m", 2.0, 0.1), parameter("c", 10.0, 2.0), parameter("d", 1.0, 0.5)]
    uses = {"train": runs(2, dict(values), forces), "test": runs(1, dict(values), forces, 7)}
    if validate is not None:
        uses["validate"] = validate
    parts = {
        use: WindowResiduals(Oscillator(), own, np.array([NOISE]), each) for use, own in uses.items()
    }
    tried = candidates(["f"], ["x", "v"], ["x"]) if possible else []
    return calibrate(parts, tried, ["x"], ["m"], {"f": 2.0})


CASES = {
    "nothing": ({}, (), "none"),
    "a parameter": ({"c": 11.0}, (), "parameters"),
    "physics": ({}, (DRAG,), "found"),
    "both": ({"c": 11.0}, (DRAG,), "found"),
}


@pytest.mark.parametrize(
    "name", [pytest.param(n, marks=pytest.mark.quick) if n == "physics" else n for n in CASES]
)
def test_what_is_off_or_missing_is_found_with_its_value(name):
    values, forces, verdict = CASES[name]
    found = judged(values, forces)
    assert found.verdict == verdict
    assert found.changed == (verdict != "none")
    assert [v.parameter.name for v in found.values if v.moved] == [*values]
    truth = {"m": 2.0, "c": 10.0, "d": 1.0} | values
    for v in found.values:
        low, high = v.ci95
        assert low - 0.5 * (high - low) < truth[v.parameter.name] < high + 0.5 * (high - low)
        assert v.value == pytest.approx(v.parameter.at(v.z) if found.changed else v.parameter.value)
    assert [a.force.id for a in found.forces] == ["f:|v|v"] * len(forces)
    for a in found.forces:
        assert a.force.coefficient == pytest.approx(-3.0, rel=0.05)
        assert a.probability > 0.99
        assert a.together >= a.probability
    before, after = found.errors["run7"]["x"]
    assert after == pytest.approx(NOISE, rel=0.15)
    assert (after < 0.8 * before) == found.changed
    change, error = found.changes["run7"]
    assert (change < -2.0 * error) == found.changed
    assert not found.remainder.significant
    q = 3 + len(forces)
    assert found.covariance.shape == (q, q)
    assert np.linalg.eigvalsh(found.covariance).min() > 0.0
    assert found.rejected == ""


def test_what_no_force_can_show_is_unexplained():
    found = judged(forces=(DRAG,), possible=False)
    assert found.verdict == "unexplained"
    assert found.remainder.significant
    assert found.remainder.sentence.startswith("A residual above the noise remains in x: ")


def test_validation_runs_reject_what_makes_them_worse():
    """Of a ship without the drag that the training runs have."""
    found = judged(forces=(DRAG,), validate=runs(2, {}, (), 5))
    assert found.verdict == "unexplained"
    assert found.rejected == "with it the prediction error of the validation runs is larger"
    assert not found.changed
    assert found.forces == []
    assert [v.value for v in found.values] == [2.0, 10.0, 1.0]
    assert found.errors["run5"]["x"][0] == found.errors["run5"]["x"][1]
    kept = judged(forces=(DRAG,), validate=runs(2, {}, (DRAG,), 5))
    assert (kept.verdict, kept.rejected) == ("found", "")


# The rule of the verdict, each branch by its own sentence


def accepted(probability=0.9, together=0.95, alike=()):
    return Accepted(DRAG, probability, together, tuple(alike))


def rest(p=0.5, share=0.1, matters=True):
    return SystemRemainder(
        [
            OutputRemainder("x", "m", 0.1, share, p, matters),
            OutputRemainder("y", "m", 0.0, 0.0, 1.0, False),
        ]
    )


@pytest.mark.parametrize(
    ("forces", "moved", "left", "rejected", "verdict"),
    [
        ([accepted()], Moved(False, ()), rest(), False, "found"),
        ([accepted(0.8)], Moved(False, ()), rest(), False, "found"),
        ([accepted(0.79)], Moved(False, ()), rest(), False, "ambiguous"),
        ([accepted(alike=["f:v"])], Moved(False, ()), rest(), False, "ambiguous"),
        ([accepted()], Moved(False, ()), rest(1e-9, 0.4), False, "found"),
        ([accepted()], Moved(False, ()), rest(1e-9, 0.6), False, "unexplained"),
        ([accepted()], Moved(False, ()), rest(1e-9, 0.6, False), False, "found"),
        ([accepted(0.4, 0.5)], Moved(False, ()), rest(), False, "ambiguous"),
        ([accepted(0.4, 0.4)], Moved(False, ()), rest(), False, "none"),
        ([], Moved(True, (True,)), rest(1e-9), False, "unexplained"),
        ([], Moved(True, (True, False)), rest(), False, "parameters"),
        ([], Moved(True, (False, False)), rest(), False, "ambiguous"),
        ([], Moved(False, (False,)), rest(), False, "none"),
        ([accepted()], Moved(True, (True,)), rest(), True, "unexplained"),
    ],
)
def test_the_verdict_follows_its_rule(forces, moved, left, rejected, verdict):
    assert verdict_of(forces, moved, None, left, rejected) == verdict


def test_a_remainder_is_significant_by_its_share_of_all_outputs():
    """The chance of a false report is shared by the outputs: two have 0.005 each."""
    assert rest(0.0049).significant
    assert not rest(0.0051).significant
    assert rest(0.0051).by_chance
    assert not rest(0.0049).by_chance
    assert not rest(0.0049, matters=False).significant
    assert "not distinguishable from noise" in rest().sentence
    assert rest(1e-9, 0.25).sentence == (
        "A residual above the noise remains in x: 0.1 m (25% of its initial squared error)."
    )


# Forces


def test_a_force_has_the_name_the_unit_and_the_terms_of_its_function():
    plain = [AdditionalForce("f", "v", k) if k else AdditionalForce("f") for k in range(4)]
    assert [f.id for f in plain] == ["f:1", "f:v", "f:|v|v", "f:v³"]
    assert [f.unit("N", "m/s") for f in plain] == ["N", "N/(m/s)", "N/(m/s)^2", "N/(m/s)^3"]
    rate = AdditionalForce("f", "x", 2, True, -4.0)
    assert (rate.id, rate.unit("N", "m")) == ("f:|der(x)|der(x)", "N/(m/s)^2")
    assert [tuple(t)[:5] for t in rate.terms(["g", "f"], ["v", "x"])] == [(1, 1, 2, True, -4.0)]
    assert AdditionalForce("f").terms(["f"], ["x"])[0].power == 0
    assert (rate.inputs, rate.signal, AdditionalForce("f").signal) == (["f"], "x", "")
    north = EarthDirection("F_n", "psi", 0.5, (("X", 2.0, 0.0), ("Y", 3.0, 1.5)))
    earth = AdditionalForce("X", coefficient=0.25, earth=north)
    assert (earth.id, earth.unit("kN", "rad"), earth.inputs, earth.signal) == (
        "earth_force:F_n",
        "N",
        ["X", "Y"],
        "psi",
    )
    assert [tuple(t) for t in earth.terms(["Y", "X"], ["u", "psi"])] == [
        (1, 1, 1, False, 0.5, 0.5, 0.0),
        (0, 1, 1, False, 0.75, 0.5, 1.5),
    ]


def test_every_function_of_every_output_is_tried_and_rates_of_measured_ones():
    found = candidates(["f", "g"], ["x", "v"], ["x"])
    assert len(found) == 2 * (1 + 3 * 3)
    assert {f.output for f in found if f.rate} == {"x"}
    assert sorted({f.power for f in found}) == [0, 1, 2, 3]
    assert all(bool(f.power) == bool(f.output) for f in found)
