"""An FMU's own parameters on data: what is read, how sure values are, and the verdict."""

import json
import re
import sys
from itertools import pairwise
from types import SimpleNamespace
from typing import Any

import numpy as np
import pandas as pd
import pytest
from scipy.io import loadmat
from support import foreign
from support.foreign import needs_compiler
from support.oscillator import build_oscillator

import cosim
from benchmarks.foreign_parameters import hidden_causes
from benchmarks.foreign_parameters.c_fmu import CSystem, Quantity, build_c_fmu
from benchmarks.foreign_parameters.foreign_systems import ForeignSystem
from cosim import InputError, Unit
from cosim.fmu import ConfinedFmu, FmuModel
from diagnosis import learn, linearise, parameters
from diagnosis.fmu_parameters.additional_force import AdditionalForce
from diagnosis.fmu_parameters.linear_model import linearised, states_of
from diagnosis.fmu_parameters.measured_system import (
    MeasuredRun,
    Window,
    noise_of,
    noises,
    windows_of,
)
from diagnosis.fmu_parameters.output.found_fmu import write_found
from diagnosis.fmu_parameters.parameter_file import (
    CalibratedParameter,
    Prior,
    kind_of,
    proposed,
    read_parameters,
)
from diagnosis.fmu_parameters.residuals import Setting, WindowResiduals
from diagnosis.fmu_parameters.sensitivity import confounded
from diagnosis.fmu_parameters.ship_task import ShipTask
from diagnosis.fmu_parameters.system_map import SystemMap, check_map, force_inputs
from diagnosis.fmu_parameters.system_remainder import (
    _beyond,
    _chance,
    _spread,
    change_of_squares,
    inflation,
)
from diagnosis.predictors.black_box import laid
from diagnosis.predictors.fmu.fmu_playback import Playback, PlaybackRequest, PlayedBack, Processes
from fmus.ops import wrap

pytestmark = needs_compiler

H, NOISE = 0.1, 1e-3
MAP = {"inputs": {"force": "f"}, "outputs": {"position": "x"}}
START = {"position": "x0", "der(position)": "v0"}
DRAG = AdditionalForce("f", "v", 2, False, -3.0)


@pytest.fixture(scope="module")
def fmu(tmp_path_factory):
    return build_oscillator(tmp_path_factory.mktemp("oscillator"))


@pytest.fixture
def work(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return tmp_path


def played_back(fmu, driven, seen, prediction, forces=()):
    """Outputs (steps + 1, m) of an FMU; forces may be functions of its speed and place."""
    known = ["x", "v"] if forces else seen
    terms = [t for f in forces for t in f.terms([driven], known)]
    playback = Playback(ConfinedFmu(FmuModel(fmu)), [driven], known)
    found = playback.run(prediction._replace(terms=terms))
    playback._fmu.close()
    assert not found.fault
    return found.outputs[:, : len(seen)]


def measured(fmu, folder, name, values, forces=(), seed=1, seconds=30.0):
    """A run of the FMU with other values and a force beside it, and noise, as a CSV file."""
    rng = np.random.default_rng(seed)
    t = H * np.arange(round(seconds / H) + 1)
    force = 2.0 * np.sin(0.7 * t + seed) + 1.5 * rng.uniform(-1.0, 1.0, t.size)[(t / 3.0).astype(int)]
    (x,) = played_back(fmu, "f", ["x"], PlaybackRequest(H, values, force[:-1, None]), forces).T
    table = {"time": t, "force": force, "position": x + NOISE * rng.standard_normal(t.size)}
    path = folder / f"{name}.csv"
    pd.DataFrame(table).to_csv(path, index=False)
    return str(path)


def written(path, content):
    path.write_text(json.dumps(content))
    return str(path)


def some(names="mcd", **changes):
    """A file of parameters: mass, spring and damper."""
    each = [x for x in (("m", 2.0, 0.1), ("c", 10.0, 0.3), ("d", 1.0, 0.5)) if x[0] in names]
    return {
        "parameters": [
            {"name": n, "value": v, "log": True, "prior": {"rel_std": s}, **changes.get(n, {})}
            for n, v, s in each
        ]
    }


# What is read


def test_proposal_has_the_prior_of_each_kind(fmu):
    found, left_out = proposed(FmuModel(fmu), {"x0", "v0"})
    assert {p.name: (p.prior.rel_std, p.log) for p in found} == {
        "m": (0.1, True), "c": (0.3, True), "d": (0.5, True), "unused": (0.3, False)
    }  # fmt: skip
    assert [s.partition(";")[0] for s in left_out] == ["left out: c3"]
    (c,) = (p for p in found if p.name == "c")
    assert (c.min, c.max, c.unit) == (0.0, 100.0, "N/m")


def test_damping_by_a_square_is_no_mass():
    assert kind_of(Unit("N.s2/m", (1, 0, 0, 0, 0, 0, 0), 1.0, 0.0)).name == "quadratic damping"
    assert kind_of(Unit("kg", (1, 0, 0, 0, 0, 0, 0), 1.0, 0.0)).name == "mass"
    assert kind_of(None).name == "other"


@pytest.mark.parametrize("log", [False, True])
def test_values_and_standard_deviations_are_inverse(log):
    p = CalibratedParameter(name="k", value=4.0, min=0.0, max=9.0, log=log, prior=Prior(rel_std=0.5))
    for z in (-1.5, 0.0, 0.7):
        assert p.z(p.at(z)) == pytest.approx(z, abs=1e-12)
        ahead, behind = p.at(z + 1e-6), p.at(z - 1e-6)
        assert p.slope(z) == pytest.approx((ahead - behind) / 2e-6, rel=1e-6)
    assert p.at(p.bounds[1]) == pytest.approx(9.0)


WRONG = {
    "unknown name": (some(c={"name": "k"}), "no parameter 'k'"),
    "no prior": ({"parameters": [{"name": "c", "value": 1.0}]}, "prior"),
    "two priors": (some(c={"prior": {"std": 1.0, "rel_std": 0.1}}), "either 'std' or 'rel_std'"),
    "outside": (some(c={"min": 11.0}), "from 'min' to 'max'"),
    "log of a negative one": (some(c={"value": -1.0}), "positive"),
    "of the map": (some(c={"name": "f"}), "variable of the map"),
    "twice": (some(c={"name": "m"}), "twice"),
    "extra key": (some(c={"guess": 1}), "guess"),
    "misspelt key": (some(c={"valu": 1}), "did you mean 'value'"),
    "misspelt key of a prior": (some(c={"prior": {"relstd": 1}}), "did you mean 'rel_std'"),
    "misspelt list": ({"parameter": []}, "did you mean 'parameters'"),
    "none": ({"parameters": []}, "parameters"),
    "no object": ([1], "parameters.json"),
}


@pytest.mark.parametrize("name", WRONG)
def test_wrong_parameters_are_refused(fmu, tmp_path, name):
    content, message = WRONG[name]
    path = tmp_path / "parameters.json"
    written(path, content)
    with pytest.raises(InputError, match=message):
        read_parameters(path, FmuModel(fmu), {"f", "x"})


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"outputs": {"position": "y"}}, "no output 'y'"),
        ({"inputs": {"force": "x"}}, "no input 'x'"),
        ({"start": {"velocity": "v0"}}, r"der\(COLUMN\)"),
        ({"disturbance_inputs": ["c"]}, "no input 'c'"),
        ({"outputs": {"position": {"name": "x", "factor": 0.0}}}, "must not be zero"),
    ],
)
def test_wrong_map_is_refused(fmu, change, message):
    with pytest.raises(InputError, match=message):
        check_map(SystemMap.model_validate({**MAP, **change}), FmuModel(fmu), "map.json")


def test_force_inputs_are_those_in_newtons(fmu):
    given = SystemMap.model_validate(MAP)
    assert force_inputs(given, FmuModel(fmu)) == ["f"]
    assert force_inputs(given.model_copy(update={"disturbance_inputs": []}), FmuModel(fmu)) == []


# Properties


def test_the_noise_of_an_output_is_given_or_the_median_of_runs_and_never_zero():
    """In the unit of the variable; of an exact channel the digits of its numbers, of a constant one tiny."""
    t = np.linspace(0.0, 10.0, 2001)
    rng = np.random.default_rng(0)
    sizes = (0.01, 0.02, 0.3)
    runs = [
        SimpleNamespace(name="a", columns={"y": 5.0 * np.sin(t) + s * rng.normal(size=t.size)})
        for s in sizes
    ]

    def noise(columns, **column):
        given = SimpleNamespace(
            outputs={"y": SimpleNamespace(**{"noise": None, "factor": -2.0} | column)}
        )
        return noises(columns, given)[0]

    assert noise(runs) == pytest.approx(2.0 * 0.02, rel=0.1)
    assert noise(runs, noise=0.5) == 2.0 * 0.5
    line = [SimpleNamespace(name="a", columns={"y": 40.0 * t})]
    assert noise(line) == pytest.approx(2.0 * 1e-5 * np.std(40.0 * t))
    still = [SimpleNamespace(name="a", columns={"y": 0.0 * t})]
    assert 0.0 < noise(still) < 1e-100
    with pytest.raises(InputError, match="column 'y' has no samples in 'a'"):
        noise([SimpleNamespace(name="a", columns={"y": np.full(9, np.nan)})])


def test_noise_of_a_smooth_signal_is_found():
    t = 0.02 * np.arange(5000)
    noisy = np.sin(t) + 0.01 * np.random.default_rng(1).standard_normal(t.size)
    assert noise_of(noisy) == pytest.approx(0.01, rel=0.05)
    assert noise_of(np.round(np.sin(t), 2)) > 0.0


@pytest.mark.parametrize(
    "signal", [lambda k: np.sin(0.25 * k), lambda k: (k // 40) % 2], ids=["few samples", "steps"]
)
def test_noise_is_not_that_which_a_signal_does_between_samples(signal):
    noisy = signal(np.arange(2000)) + 0.01 * np.random.default_rng(1).standard_normal(2000)
    assert noise_of(noisy) == pytest.approx(0.01, rel=0.1)


def test_slopes_of_a_prediction_that_bends_are_those_of_its_equation():
    """An oscillation of 40 periods: a fiftieth of the prior turns its end by half of a period."""
    t = np.linspace(0.0, 40.0, 801)
    p = CalibratedParameter(name="w", value=2.0 * np.pi, prior=Prior(rel_std=0.5))

    def run(requests):
        return [PlayedBack(np.sin(r.start["w"] * t)[:, None]) for r in requests]

    w = Window("run", 0.0, PlaybackRequest(0.05, {}, np.zeros((800, 0))), t, np.zeros((801, 1)), {})
    r = WindowResiduals(SimpleNamespace(run=run, name="fmu"), [w], np.array([0.01]), [p])
    r.whiten_about(Setting((0.0,)))
    J, faults = r.slopes(Setting((0.0,)), ())
    exact = -p.std * t * np.cos(p.value * t) / 0.01
    assert not faults
    assert np.abs(J[:, 0] - exact).max() < 1e-3 * np.abs(exact).max()


def test_groups_are_those_that_the_predictions_do_not_discriminate():
    X = np.random.default_rng(0).standard_normal((400, 8))
    twice = np.column_stack([X[:, 0], 3.0 * X[:, 0], X[:, 1]])
    thrice = np.column_stack([twice, -X[:, 0]])
    scale = np.column_stack([X[:, :4], -X[:, :4].sum(axis=1), X[:, 5]])  # all five by one factor
    pairs = np.column_stack([X[:, 0], X[:, 0] + 0.2 * X[:, 6], X[:, 1], X[:, 1] + 1e-4 * X[:, 2]])
    cases = [(X, []), (twice, ["ab"]), (thrice, ["abd"]), (scale, ["abcde"]), (pairs, ["ab", "cd"])]
    for slopes, groups in cases:
        names = "abcdefgh"[: slopes.shape[1]]
        assert ["".join(g) for g in confounded(slopes, names)] == groups


def windows(*measured, runs=None, angles=()):
    """What the remainder looks at: windows of some outputs, a second from sample to sample."""
    each = [
        SimpleNamespace(measured=m, time=3.0 + np.arange(len(m)), run=run)
        for m, run in zip(measured, runs or ["a"] * len(measured), strict=True)
    ]
    ends = np.cumsum([0, *(m.size for m in measured)])
    rows = [slice(a, b) for a, b in pairwise(ends.tolist())]
    noise = np.ones(measured[0].shape[1])
    return SimpleNamespace(windows=each, rows=rows, angles=angles, noise=noise)


def test_the_spread_of_an_output_is_about_the_line_of_each_window():
    t, rng = 3.0 + np.arange(30.0), np.random.default_rng(0)
    first, second = (
        np.column_stack([5.0 + 2.0 * t, wrap(t / 3.0)]) + rng.normal(size=(30, 2)) for _ in "ab"
    )
    second[4, 0] = np.nan
    r = windows(first, second, angles=[1])
    known = np.isfinite(second[:, 0])
    lines = [
        np.polyval(np.polyfit(x, y, 1), x) - y
        for x, y in ((t, first[:, 0]), (t[known], second[known, 0]))
    ]
    assert _spread(r, 0) == pytest.approx(np.concatenate(lines).std(), rel=1e-6)
    still = windows(np.column_stack([7.0 - 0.5 * t, wrap(t / 3.0)]), angles=[1])
    assert [_spread(still, k) for k in (0, 1)] == pytest.approx([0.0, 0.0], abs=1e-12)


@pytest.mark.parametrize(("lasts", "size"), [(1, 1.0), (20, 0.5), (20, 2.0)])
def test_what_lasts_is_beyond_white_noise_and_no_chance(lasts, size):
    """Noise of unit size, and in addition an error that keeps its sign for some samples."""
    rng = np.random.default_rng(1)
    parts = [
        rng.normal(size=4000) + (lasts > 1) * size * np.repeat(rng.choice([-1.0, 1.0], 200), 20)
        for _ in "ab"
    ]
    known = [np.arange(4000) % 7 != 0, np.ones(4000, bool)]
    expected = size if lasts > 1 else 0.0
    assert _beyond(parts, known) == pytest.approx(expected, abs=0.05 + 0.08 * expected)
    assert (_chance(parts, known, 3.0) < 1e-6) == (lasts > 1)
    assert _beyond([np.zeros(3)], [np.ones(3, bool)]) == 0.0
    assert _chance([np.zeros(3)], [np.ones(3, bool)], 0.0) == 1.0, "of too few nothing is told"


@pytest.mark.parametrize("lasts", [1, 10])
def test_variances_grow_by_how_long_residuals_last(lasts):
    rng = np.random.default_rng(2)
    slopes, found = np.full((800, 1), 0.1), []
    for _ in range(100):
        white = np.repeat(rng.normal(size=800 // lasts), lasts)
        found.append(inflation(windows(white.reshape(-1, 2)), white, slopes, slopes.T @ slopes))
    assert np.mean(found) == pytest.approx(lasts, rel=0.35)  # 1 at the least
    r = windows(white.reshape(-1, 2))
    assert inflation(r, white, np.zeros((800, 0)), np.zeros((0, 0))) == 1.0


def test_laid_track_begins_where_it_is_laid_and_keeps_its_shape():
    track = np.column_stack([np.arange(5.0), np.zeros(5), np.zeros(5)])
    onto = np.array([[2.0], [3.0], [np.pi / 2]])
    moved = laid(track[..., None], np.zeros(1), onto)[..., 0]
    assert moved[0] == pytest.approx([2.0, 3.0, np.pi / 2])
    assert moved[4] == pytest.approx([2.0, 7.0, np.pi / 2])


def test_start_values_are_those_of_the_motion(fmu):
    t = H * np.arange(200)
    noise = 1e-3 * np.random.default_rng(3).standard_normal(t.size)
    run = MeasuredRun("r", t, {"force": 0.0 * t, "position": np.sin(t) + noise})
    given = SystemMap.model_validate({**MAP, "start": START})
    found = windows_of(run, given, FmuModel(fmu), noises([run], given), 5.0)
    assert len(found) == 3  # the remainder is dropped
    for w in found:
        assert w.course.start["x0"] == pytest.approx(np.sin(w.begin), abs=4.0 * w.start_std["x0"])
        assert w.course.start["v0"] == pytest.approx(np.cos(w.begin), abs=4.0 * w.start_std["v0"])
        # At most as uncertain as three times one sample, and not as certain as the mean of all.
        assert 3e-3 > w.start_std["x0"] > 1e-3 / np.sqrt(t.size)


def test_playback_adds_a_force_as_the_fmu_has_it(fmu):
    """A spring beside the FMU is its own spring, but for what a step is late."""
    force = np.sin(0.5 * np.arange(2000) * 0.01)[:, None]
    plain, own = (
        played_back(fmu, "f", ["x", "v"], PlaybackRequest(0.01, values, force))
        for values in ({}, {"c": 11.0})
    )
    spring = AdditionalForce("f", "x", 1, False, -1.0)
    beside = played_back(fmu, "f", ["x", "v"], PlaybackRequest(0.01, {}, force), [spring])
    assert np.abs(own - beside).max() < 0.05 * np.abs(own - plain).max()


# Linear model


@pytest.mark.parametrize("seen", [{"position": "x"}, {"position": "x", "speed": "v"}])
def test_linear_model_of_the_oscillator_is_its_equation(fmu, work, seen):
    second = "speed" if "speed" in seen else "der(position)"
    content = {"outputs": seen, "start": {"position": "x0", second: "v0"}}
    at = written(work / "at.json", {"x0": 0.2, "v0": -0.1, "f": 1.0, "c": 20.0})
    given = written(work / "map.json", content)
    assert linearise.main([str(fmu), "--operating-point", at, "--map", given, "--out", "linear"]) == 0
    found = json.loads((work / "linear/linear.json").read_text())
    assert np.allclose(found["A"], [[0.0, 1.0], [-10.0, -0.5]], atol=5e-3)
    assert np.allclose(found["B"], [[0.0], [0.5]], atol=1e-3)
    seen_by = [[1.0, 0.0], [0.0, 1.0], [0.0, 1.0], [-10.0, -0.5]]
    assert np.allclose(found["C"], seen_by, atol=1e-6)
    assert np.allclose(found["D"], [[0.0], [0.0], [0.0], [0.5]], atol=1e-6)
    assert found["x_dot"] == pytest.approx([-0.1, (1.0 - 4.0 + 0.1) / 2.0], abs=1e-3)
    assert [s["name"] for s in found["states"]] == ["x0", "v0"]
    assert [o["unit"] for o in found["outputs"]] == ["m", "m/s", "m/s", "m/s2"]
    mat = loadmat(work / "linear/linear.mat")
    assert np.array_equal(mat["A"], found["A"])
    assert [str(x[0]) for x in mat["states"].ravel()] == ["x0", "v0"]


def test_the_change_of_squares_has_the_error_of_its_blocks():
    w = SimpleNamespace(run="a", measured=np.zeros((80, 1)))
    r = SimpleNamespace(windows=[w], parts=lambda x: [(w, x)])
    before, after = np.random.default_rng(0).standard_normal((2, 80))
    each = (after**2 - before**2).reshape(8, 10).sum(axis=1)
    expected = each.sum(), each.std(ddof=1) * np.sqrt(8)
    assert change_of_squares(r, before, after, ["a"]) == pytest.approx(expected)
    assert change_of_squares(r, before, after, ["b"]) == (0.0, 0.0)


# In place of that of support.foreign: T der(y) = u - y^3, with its derivatives if the last one is asked.
CUBIC = {
    "double all[] = {m->u, m->y, m->T};": "double all[] = {m->u, m->y, m->T, RATE};",
    "if (vr[k] > 2) return 3;": "if (vr[k] > 3) return 3;",
    "if (vr[k] == 0) m->u": "if (vr[k] == 1) m->y = v[k]; else if (vr[k] == 0) m->u",
    "const double dk[], double du[]) { return 3; }": """const double dk[], double du[]) {
    Lag *m = c; for (size_t i = 0; i < nu; i++) { du[i] = 0.0; for (size_t j = 0; j < nk; j++) {
        if (u[i] == 1) continue; /* as the Reference FMUs: 0 of a state that is an output */
        else du[i] += dk[j] * (k[j] == 1 ? -3.0 * m->y * m->y / m->T : 1.0 / m->T); } } return 0; }""",
}
CUBIC_VARIABLES = """<ScalarVariable name="der(y)" valueReference="3" causality="output" initial="calculated">
<Real derivative="2"/></ScalarVariable></ModelVariables>"""
CUBIC_STRUCTURE = """<ModelStructure><Outputs><Unknown index="2"/><Unknown index="6"/></Outputs>
<Derivatives><Unknown index="6"/></Derivatives></ModelStructure>"""


@pytest.mark.parametrize("provided", [True, False])
def test_derivatives_of_the_fmu_are_those_of_differences(work, monkeypatch, provided):
    source, described = foreign.SOURCE, foreign.DESCRIPTION
    for old, new in CUBIC.items():
        assert old in source
        source = source.replace(old, new.replace("RATE", "(m->u - m->y * m->y * m->y) / m->T"))
    described = described.replace("</ModelVariables>", CUBIC_VARIABLES)
    described = re.sub("<ModelStructure>.*</ModelStructure>", CUBIC_STRUCTURE, described)
    monkeypatch.setattr(foreign, "SOURCE", source)
    monkeypatch.setattr(foreign, "DESCRIPTION", described)
    stated = f'{foreign.ANY_STEP} providesDirectionalDerivative="{str(provided).lower()}"'
    model = FmuModel(foreign.build_lag(work, capabilities=stated))
    at = {"out, filtered": 0.7, "in[1]": 0.2, "T": 2.0}
    states = states_of(model, None)
    given = {"outputs": {"y": "out, filtered"}, "start": {"y": "out, filtered"}}
    assert states_of(model, SystemMap.model_validate(given)) == states  # by the rate that it declares
    found = linearised(model, states, at, ["out, filtered"])
    # A central difference of a cube is off by the square of its step, which is 1e-3 here.
    error = {"abs": 1e-12 if provided else 1e-6}
    assert pytest.approx(np.array([[-3.0 * 0.49 / 2.0]]), **error) == found.A
    assert pytest.approx(np.array([[0.5]]), abs=1e-9) == found.B
    assert pytest.approx(np.array([[1.0]]), abs=1e-9) == found.C
    assert pytest.approx(np.array([[0.0]]), abs=1e-9) == found.D
    assert found.x_dot == pytest.approx([(0.2 - 0.343) / 2.0])


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--operating-point", "at.json"], "'y0' cannot be set"),
        (["--time", "3"], "belong together"),
    ],
)
def test_state_that_cannot_be_is_refused(fmu, work, capsys, arguments, message):
    written(work / "at.json", {"y0": 1.0})
    given = written(work / "map.json", {**MAP, "start": START})
    assert linearise.main([str(fmu), *arguments, "--map", given, "--out", "linear"]) == 2
    assert message in " ".join(capsys.readouterr().err.split())
    assert not (work / "linear").exists()


def test_rates_by_steps_that_a_coarse_fmu_spoils_are_reported(work, capsys):
    coarse = build_oscillator(work, "coarse", habit="p[V_v] = round(p[V_v] * 1e5) / 1e5;")
    given = written(work / "map.json", {**MAP, "start": START})
    assert linearise.main([str(coarse), "--map", given, "--out", "linear"]) == 0
    assert "A is uncertain by" in capsys.readouterr().out


def test_fmu_whose_states_cannot_be_set_is_refused(work, capsys):
    closed = build_oscillator(work, "closed", left_out=("x0", "v0"))
    assert linearise.main([str(closed), "--out", "linear"]) == 2
    assert "no state of 'closed.fmu' can be set" in " ".join(capsys.readouterr().err.split())


@pytest.mark.slow
@pytest.mark.parametrize("force", [DRAG, AdditionalForce("f", "x", 1, True, -1.0), AdditionalForce("f")])
def test_found_fmu_moves_as_the_fit_has_it(fmu, work, force):
    inputs, values = np.repeat([2.0, -1.0, 0.5], 20)[:, None], {"c": 12.0, "m": 2.1}
    given = {"inputs": {"force": "f"}, "outputs": {"position": "x"}, "start": START}
    sentence = write_found(work, FmuModel(fmu), given, values, [force], H)
    assert sentence.startswith("found.fmu is oscillator.fmu with")
    new = json.loads((work / "map.json").read_text())
    assert new["start"] == {"position": "model.x0", "der(position)": "model.v0"}
    fitted = played_back(fmu, "f", ["x", "v"], PlaybackRequest(H, values, inputs), [force])
    name = new["inputs"]["force"]
    made = played_back(work / "found.fmu", name, ["model.x", "model.v"], PlaybackRequest(H, {}, inputs))
    assert np.abs(fitted).max() > 0.1
    assert made == pytest.approx(fitted, abs=1e-12)


# Commands


def test_parameters_without_runs(fmu, work, capsys):
    assert parameters.main([str(fmu)]) == 0
    names = [p["name"] for p in json.loads((work / "parameters.json").read_text())["parameters"]]
    assert names == ["m", "c", "d", "unused"]
    stated = " ".join(capsys.readouterr().out.split())
    assert stated.count("left out: ") == stated.count("; a value of 0 without a range has no scale") == 1
    assert "c3" in stated.partition("left out: ")[2]
    assert parameters.main([str(fmu)]) == 2
    assert "--overwrite" in capsys.readouterr().err


def test_fmu_without_parameters(work, capsys):
    bare = build_oscillator(work, "bare", left_out=("m", "c", "d", "x0", "v0", "c3", "unused"))
    assert parameters.main([str(bare)]) == 2
    assert "no parameter that can be calibrated" in " ".join(capsys.readouterr().err.split())
    assert not (work / "parameters.json").exists()


@pytest.mark.slow
def test_fmu_without_parameters_is_searched_for_forces(fmu, work, capsys):
    run = measured(fmu, work, "run", {}, [DRAG])
    bare = build_oscillator(work, "bare", left_out=("m", "c", "d", "x0", "v0", "c3", "unused"))
    given = written(work / "map.json", MAP)
    assert learn.main([run, "--model", str(bare), "--map", given, "--out", "out"]) == 0
    assert "no parameter that can be calibrated" in " ".join(capsys.readouterr().out.split())
    found = json.loads((work / "out/diagnosis.json").read_text())
    assert (found["verdict"], found["parameters"]) == ("found", [])
    assert [e["id"] for e in found["effects"]] == ["f:|v|v"]


@pytest.mark.slow
def test_parameters_that_imitate_a_force_do_not_hide_it(work):
    """Without drag the fit of this spring ends at a mass of twenty times the true one."""
    start = {"x": Quantity(1.0, "m"), "v": Quantity(0.0, "m/s")}
    values = {"k": (1.0, 0.3), "c": (1.0, 0.3), "m": (1.0, 0.01)}
    each = {n: Quantity(v, "1") for n, (v, _) in values.items()}
    still = CSystem({"f": Quantity(0.0, "m")}, start, each, "der_x = 0.0; der_v = 0.0;")
    euler = (
        "double rate = (p[V_k] * (p[V_f] - p[V_x]) - p[V_c] * p[V_x]) / p[V_m]; "
        "p[V_x] += h * p[V_v]; p[V_v] += h * rate;"
    )
    path = build_c_fmu(work, "euler", still, euler)
    s = ForeignSystem("euler", {"f": 0.5}, "x", "c", values, "f", ("v", 2), -0.3, samples=200)
    hidden_causes.measured(path, s, {}, True, 0).to_csv(work / "r0.csv", index=False)
    s.write_inputs(work)
    given = ["--map", "map.json", "--parameters", "parameters.json", "--out", "out"]
    assert learn.main(["r0.csv", "--model", str(path), *given]) == 0
    found = json.loads((work / "out/diagnosis.json").read_text())
    assert (found["verdict"], [e["id"] for e in found["effects"]]) == ("found", ["f:|v|v"])
    assert not any(p["moved"] for p in found["parameters"])


@pytest.mark.slow
def test_parameters_that_runs_determine(fmu, work, capsys):
    run = measured(fmu, work, "run", {})
    given = written(work / "map.json", MAP)
    assert parameters.main([str(fmu), "--map", given, "--runs", run]) == 0
    names = [p["name"] for p in json.loads((work / "parameters.json").read_text())["parameters"]]
    assert names == ["m", "c", "d"]
    assert "no influence" in " ".join(capsys.readouterr().out.split())


@pytest.mark.slow
def test_values_known_only_together_are_said(work, capsys):
    """Only the product of spring constant and another value acts."""
    fmu = build_oscillator(
        work, "product", habit="p[V_f] += p[V_c] * p[V_x] - p[V_c] * p[V_unused] * p[V_x];"
    )
    run = measured(fmu, work, "run", {})
    assert parameters.main([str(fmu), "--map", written(work / "map.json", MAP), "--runs", run]) == 0
    assert "identifiable only together: c, unused" in " ".join(capsys.readouterr().out.split())


def test_verdict(fmu, work):
    """A parameter that is off, and physics that are missing; other verdicts are in test_fmu_calibration.py."""
    values, forces = {"c": 12.0}, (DRAG,)
    train = [measured(fmu, work, f"run{k}", values, forces, seed=k) for k in (1, 2)]
    test = measured(fmu, work, "other", values, forces, seed=3)
    given = written(work / "map.json", MAP)
    own = written(work / "parameters.json", some())
    options = ["--model", str(fmu), "--map", given, "--parameters", own, "--out", "out"]
    assert learn.main([*train, "--test", test, *options]) == 0
    found = json.loads((work / "out/diagnosis.json").read_text())
    assert found["verdict"] == "found"
    assert {p["name"] for p in found["parameters"] if p["moved"]} == set(values)
    for p in found["parameters"]:
        low, high = p["ci95"]
        truth = {"m": 2.0, "c": 10.0, "d": 1.0, **values}[p["name"]]
        wide = high - low  # twice the interval: one of fifteen misses its own
        assert low - 0.5 * wide < truth < high + 0.5 * wide
        assert low <= p["value"] <= high
    assert [e["id"] for e in found["effects"]] == [f.id for f in forces]
    for e in found["effects"]:
        value = e["coefficients"]["f:|v|v"]
        assert value["value"] == pytest.approx(-3.0, rel=0.05)
        assert value["unit"] == "N/(m/s)^2"
        assert e["confidence"] >= 0.8
    (held_out,) = (e for e in found["errors"] if e["held_out"])
    error = held_out["outputs"]["x"]
    assert error["after"] == pytest.approx(NOISE, rel=0.2)
    assert error["after"] < error["before"]
    assert (work / "out/found.fmu").exists()
    assert (work / "out/map.json").exists()
    ssv = cosim.read_parameters(work / "out/model.ssv").values
    fitted = {p["name"]: p["value"] for p in found["parameters"]}
    assert {n: v.value for n, v in ssv["oscillator"].items()} == fitted
    posterior = json.loads((work / "out/posterior.json").read_text())
    assert np.linalg.eigvalsh(posterior["covariance"]).min() > 0.0
    assert (work / "out/report.html").stat().st_size > 1000


@pytest.mark.slow
def test_windows_from_measured_states_agree_with_whole_runs(fmu, work):
    values = {"c": 12.0}
    run = measured(fmu, work, "run", values, seconds=18.0)
    given = written(work / "map.json", {**MAP, "start": START, "window": 6.0})
    own = written(work / "parameters.json", some("c"))
    options = ["--model", str(fmu), "--map", given, "--parameters", own, "--out", "out"]
    assert learn.main([run, *options]) == 0
    found = json.loads((work / "out/diagnosis.json").read_text())
    assert found["verdict"] == "parameters"
    (c,) = found["parameters"]
    assert c["value"] == pytest.approx(12.0, rel=5e-3)


@pytest.mark.slow
def test_range_in_which_the_fmu_fails_is_said_and_the_rest_goes_on(work, capsys):
    habit = "if (p[V_c] > 40.0) return 3; if (p[V_d] > 3.0) p[V_x] = NAN;"
    fmu = build_oscillator(work, "fragile", habit=habit)
    run = measured(fmu, work, "run", {"c": 12.0}, seconds=15.0)
    given = written(work / "map.json", MAP)
    assert learn.main([run, "--model", str(fmu), "--map", given, "--out", "out"]) == 0
    found = json.loads((work / "out/diagnosis.json").read_text())
    assert found["verdict"] == "parameters"
    notes = " ".join(found["fmu"]["notes"])
    assert "the FMU fails" in notes
    assert "x is not finite" in notes
    assert "Not identifiable from these runs: unused" in notes


@pytest.mark.slow
@pytest.mark.parametrize("unconfined", [False, True])
def test_fmu_cannot_read_the_run_unless_it_may(work, capsys, unconfined):
    """An FMU that plays the run back is found to agree with it; else the run does not exist for it."""
    path = work / "run.csv"
    habit = f"""static double y[2000]; static int rows = -1;
    if (rows < 0) {{ FILE *file = fopen("{path}", "r"); char line[200]; rows = 0;
        while (file && fgets(line, sizeof line, file))
            if (sscanf(line, "%*[^,],%*[^,],%lf", y + rows) == 1) rows++; }}
    if (rows) {{ p[V_x] = y[(int)((t + h) / {H} + 0.5)]; return 0; }}"""
    fmu = build_oscillator(work, "thief", habit=habit)
    measured(build_oscillator(work, "honest"), work, "run", {"c": 12.0})
    own = written(work / "parameters.json", some())
    options = ["--model", str(fmu), "--map", written(work / "map.json", MAP), "--parameters", own]
    assert learn.main([str(path), *options, "--out", "out", *["--unconfined"] * unconfined]) == 0
    found = json.loads((work / "out/diagnosis.json").read_text())
    assert found["fmu"]["confinement"].startswith("unconfined") == unconfined
    if sys.platform == "linux":
        assert str(path) in found["fmu"]["outside"]
        assert str(path) in " ".join(capsys.readouterr().out.split()).replace(" ", "")
    (run,) = found["errors"]
    assert (run["outputs"]["x"]["before"] < 0.1 * NOISE) == unconfined


@pytest.mark.slow
@pytest.mark.parametrize("fresh", [False, True])
def test_a_fresh_prediction_knows_nothing_of_others(work, fresh):
    """An FMU that behaves until it has run five times in a process, and then tells so."""
    habit = "static int runs; if (t == 0.0) runs++; if (runs > 5) { p[V_x] = 7.0; return 0; }"
    fmu = build_oscillator(work, "remembering", habit=habit)
    processes = Processes(ConfinedFmu(FmuModel(fmu)), ["f"], ["x"], fresh)
    found = processes.run([PlaybackRequest(H, {}, np.zeros((3, 1)))] * 16)
    processes.close()
    assert not any(f.fault for f in found)
    assert any((f.outputs == 7.0).any() for f in found) != fresh


@pytest.mark.slow
def test_fmu_that_ends_its_process_is_said(work, capsys):
    fmu = build_oscillator(work, "fatal", habit="if (t > 1.0) abort();")
    processes = Processes(ConfinedFmu(FmuModel(fmu)), ["f"], ["x"])
    first, second = processes.run([PlaybackRequest(H, {}, np.zeros((n, 1))) for n in (40, 10)])
    processes.close()
    assert "SIGABRT" in first.fault
    assert np.isnan(first.outputs).all()
    assert not second.fault
    assert np.isfinite(second.outputs).all()


@pytest.mark.slow
def test_interrupted_or_refused_calls_leave_nothing(fmu, work, capsys):
    run = measured(fmu, work, "run", {})
    for arguments, message in (
        ([run, "--parameters", "p.json"], "--model NAME.fmu is missing"),
        ([run, "--model", str(fmu)], "no column has the name of an output"),
        ([run, "--model", str(fmu), "--map", written(work / "m.json", {"outputs": {"y": "x"}})], "'y'"),
    ):
        assert learn.main([*arguments, "--out", "out"]) == 2
        assert message in " ".join(capsys.readouterr().err.split())
        assert not (work / "out").exists()


@pytest.mark.slow
def test_values_with_which_the_fmu_fails_in_a_fit_are_stated(work, capsys):
    """The truth lies where the FMU fails: nothing is explained, and the report states why."""
    fmu = build_oscillator(work, "fragile", habit="if (p[V_c] > 11.0) return 3;")
    run = measured(build_oscillator(work, "honest"), work, "run", {"c": 12.0}, seconds=8.0)
    own = written(work / "parameters.json", some("c"))
    options = ["--model", str(fmu), "--map", written(work / "map.json", MAP), "--parameters", own]
    assert learn.main([run, *options, "--out", "out"]) == 0
    found = json.loads((work / "out/diagnosis.json").read_text())
    assert found["verdict"] == "unexplained"
    assert found["parameters"][0]["value"] <= 11.0
    assert "The FMU fails with" in " ".join(capsys.readouterr().out.split())


def test_a_time_that_is_none_has_no_state():
    smoothed = SimpleNamespace(
        nu=np.zeros((3, 3)),
        time=np.arange(3.0),
        track=SimpleNamespace(period=1.0, run=SimpleNamespace(name="a")),
    )
    task: Any = SimpleNamespace(runs={"train": [SimpleNamespace(smoothed=smoothed)]})
    for time in (1e9, float("nan")):
        with pytest.raises(InputError, match="run 'a' has no state at"):
            ShipTask.state_at(task, time)
