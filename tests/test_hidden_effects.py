"""The benchmark of hidden effects: what it hides, what the diagnosis gets, what counts as separable."""

import shutil
from dataclasses import replace

import numpy as np
import pytest
from support.cases import in_part
from support.closed_form import Allocation, thrust
from support.cosimulated import build, sail
from support.cse1 import EFFECTS
from support.shared import once

from benchmarks.hidden_effects import fleet, simulated_runs
from benchmarks.hidden_effects.__main__ import main, scored
from benchmarks.hidden_effects.answers import judge
from benchmarks.hidden_effects.cells import KINDS, PAIRS, Cell, cells, for_fitting, for_showing, kind_of
from benchmarks.hidden_effects.confidence_fit import Judged, confidence, fitted
from benchmarks.hidden_effects.draw import (
    IN_NOISE,
    LARGEST,
    LOOKED_FOR,
    NOTHING_HIDDEN,
    OTHER_TIMES,
    OUTAGES,
    SINGLE,
    SMALLEST,
    UNKNOWN,
    Draw,
    added_force,
    draw,
    share,
)
from benchmarks.hidden_effects.fleet import Order, ProcessNoise, sail_all
from benchmarks.hidden_effects.foreign_physics import FOREIGN_PHYSICS
from benchmarks.hidden_effects.manoeuvres import Manoeuvre, manoeuvres
from benchmarks.hidden_effects.problems import Problem, kept, make
from benchmarks.hidden_effects.reliability_diagram import (
    Told,
    bins,
    draw_diagram,
    interval,
    mean_and_error,
    tables,
)
from benchmarks.hidden_effects.results import Results, Row
from benchmarks.hidden_effects.scoring import row, same_coefficients
from benchmarks.hidden_effects.separation import NOTHING, Rivals, flat
from benchmarks.hidden_effects.simulated_runs import STEP, Hidden, Voyage
from benchmarks.hidden_effects.summary import write
from benchmarks.hidden_effects.targets import bias
from benchmarks.hidden_effects.truth import Motion, force, motion, over, windows
from cosim import InputError
from diagnosis import Model, Run


def sailed(seconds=60.0, speed=0.3, ahead=0.08):
    """A motion made up of sines, with its exact derivatives, and commands of the same frequencies."""
    t = np.arange(round(seconds / STEP)) * STEP
    w = np.array([0.31, 0.23, 0.17]) * speed / 0.3
    size, phase = np.array([0.06, 0.05, 0.2]), np.array([0.0, 1.0, 2.0])
    nu = size * np.sin(np.outer(t, w) + phase) + [ahead, 0.0, 0.0]
    nu_dot = size * w * np.cos(np.outer(t, w) + phase)
    psi = np.cumsum(nu[:, 2]) * STEP
    eta = np.column_stack([0.0 * t, 0.0 * t, psi])
    commanded = np.column_stack(
        [0.3 * np.sin(0.4 * t) + 0.1, 0.2 * np.sin(0.5 * t), 0.1 * np.cos(0.3 * t)]
    )
    tau = np.column_stack(thrust(*commanded.T, Allocation()))
    c, s = np.cos(psi), np.sin(psi)
    earth = np.column_stack([c * nu[:, 0] - s * nu[:, 1], s * nu[:, 0] + c * nu[:, 1]])
    eta[:, :2] = [5.0, 0.5] + np.cumsum(earth, axis=0) * STEP
    return Voyage(Run("made", t, eta, tau), eta, nu, nu_dot, tau, 0.0 * tau)


VOYAGE = sailed()
# Times and a play are drawn in place of it.
OF_NO_SIZE = ("bow_failure", "bow_outage", "vsp_outage", "backlash")
RUNS = [motion(sailed(30.0), {}), motion(sailed(30.0, speed=0.5, ahead=0.0), {})]


@pytest.fixture(scope="module")
def ships(shared):
    """Folder of the FMUs, and of the runs without anything hidden that the benchmark keeps beside them."""
    return once(shared / "hidden_effects", build)


SIZED = [e for e in (*SINGLE, *UNKNOWN) if e not in OF_NO_SIZE]


@pytest.mark.parametrize(
    "effect", in_part(SIZED, keep=[e for e in SIZED if e[1:2] != "_" or e in ("X_|u|r", "N_uv")])
)
def test_size_is_what_was_drawn(effect):
    d = draw(effect, np.random.default_rng(3), RUNS)
    assert d.size == share(RUNS, effect, d.values)
    coarse = 1.35 if "delay" in effect or effect == "clock_offset" else 1.02
    assert SMALLEST / coarse < d.size < LARGEST * coarse


@pytest.mark.parametrize(
    ("effect", "axis"), [("added_mass_X", 0), ("added_mass_Y", 1), ("added_mass_N", 2)]
)
def test_heavier_ship_needs_force_in_proportion_to_what_is_added(effect, axis):
    """Also where the motion is that of a ship without it, from which sizes are drawn."""
    m = RUNS[0]
    one, hundred = force(m, {effect: 1.0}), force(m, {effect: 100.0})
    assert hundred == pytest.approx(100.0 * one, rel=1e-9, abs=1e-9)
    if axis == 2:  # an added moment of inertia takes no Coriolis force
        assert one[:, 2] == pytest.approx(-m.nu_dot[:, 2], rel=1e-9)


def test_draw_is_that_of_its_seed_and_can_be_made_smaller():
    one, same, less, other = (
        draw("X_u", np.random.default_rng(seed), RUNS, less)
        for seed, less in ((3, 1), (3, 1), (3, 0.5), (4, 1))
    )
    assert one.values == same.values != other.values
    assert less.size == pytest.approx(0.5 * one.size, rel=0.05)


def test_sizes_are_spread_evenly_over_their_logarithm():
    sizes = [draw("loss_surge", np.random.default_rng(seed), RUNS).size for seed in range(60)]
    place = np.log(np.array(sizes) / SMALLEST) / np.log(LARGEST / SMALLEST)
    assert np.mean(place) == pytest.approx(0.5, abs=0.1)
    assert np.std(place) == pytest.approx(np.sqrt(1.0 / 12.0), abs=0.05)


def test_every_effect_is_in_the_benchmark():
    todo = list(cells(KINDS, SINGLE, ["n1", "n10"], [False, True], range(2)))
    assert {e.id for e in LOOKED_FOR} | set(UNKNOWN) <= {e for cell in todo for e in cell.effects}
    assert len({cell.key for cell in todo}) == len(todo)
    assert {kind_of(cell.name) for cell in todo} == set(KINDS)


def test_twenty_pairs_half_of_them_on_one_axis():
    axes = [tuple(set(EFFECTS[e].axis) for e in pair) for pair in PAIRS]
    assert len(set(map(frozenset, PAIRS))) == 20
    assert sum(a.isdisjoint(b) for a, b in axes) >= 5
    assert sum(bool(a & b) for a, b in axes) >= 10


def test_what_is_fitted_is_never_shown():
    """No seed and no effect is on both sides but "none", of which only the seed differs."""
    names = [*SINGLE, *UNKNOWN, *(" + ".join(pair) for pair in PAIRS)]
    both = [(n, s) for n in (*names, "none") for s in range(100)]
    fit, show = ([x for x in both if side(*x)] for side in (for_fitting, for_showing))
    assert {s for _, s in fit}.isdisjoint(s for _, s in show)
    assert {n for n, _ in fit} & {n for n, _ in show} == {"none"}
    assert {n for n, _ in fit} | {n for n, _ in show} == {*names, "none"}


def test_library_knows_nothing_of_foreign_physics():
    ids = {e.id for e in FOREIGN_PHYSICS}
    parameters = {p.name for e in FOREIGN_PHYSICS for p in e.parameters}
    assert len(ids) == 6
    assert ids.isdisjoint(EFFECTS)
    assert parameters.isdisjoint(p.name for e in EFFECTS.values() for p in e.parameters)


@pytest.mark.parametrize("effect", [e for e in UNKNOWN if e != "bias by place"])
def test_no_single_candidate_expresses_foreign_physics(effect):
    """The best of all candidates leaves more than the share that makes two effects one."""
    d = draw(effect, np.random.default_rng(5), RUNS)
    left = Rivals(RUNS, False).separations(added_force(RUNS, effect, d.values), d.right)
    assert d.right == ()
    assert min(left.values()) > 0.05


def test_play_is_taken_up_before_a_command_acts():
    """A command that swings by less than the play moves nothing; a larger one is followed a half behind."""
    t = VOYAGE.measured.time
    small, large = (
        RUNS[0].__class__(t, *[0.0 * VOYAGE.eta] * 3, a * np.sin(t)[:, None] * np.ones(3))
        for a in (0.05, 0.3)
    )
    still, moved = (force(m, {"backlash": 0.06}) + m.tau for m in (small, large))
    assert np.abs(still).max() == 0.0
    assert moved[:, 0].max() == pytest.approx(1.165 * (0.3 - 0.06), rel=1e-3)


def test_rope_that_hangs_pulls_nothing():
    values = {"tether_stiffness": 1.0, "tether_slack": 50.0}
    assert np.abs(force(RUNS[0], values)).max() < 1e-12
    assert np.abs(force(RUNS[0], {**values, "tether_slack": 0.0})).max() > 0.5


@pytest.mark.parametrize(
    "effect", ["X_u", "N_|r|v", "current", "lag", "delay", "mass", "heading_offset"]
)
@pytest.mark.parametrize("nuisance", [False, True])
def test_effect_is_not_separable_from_itself(effect, nuisance):
    d = draw(effect, np.random.default_rng(1), RUNS)
    assert Rivals(RUNS, nuisance).left(flat(over(RUNS, d.values)), effect) < 5e-3


@pytest.mark.slow
def test_separations_are_shares_and_nuisance_parameters_make_them_smaller():
    hidden = over(RUNS, {"delta_X_u": -1.0})
    known, nuisance = (Rivals(RUNS, d).separations(hidden, ["X_u"]) for d in (False, True))
    assert "curve_X(u)" not in known, "it holds X_u: no rival"
    assert NOTHING not in known
    assert all(0.0 <= x <= 1.0 + 1e-9 for x in (*known.values(), *nuisance.values()))
    assert all(nuisance[e] <= x + 1e-6 for e, x in known.items())


@pytest.mark.parametrize(("a", "b"), [("X_u", "X_|u|u"), ("N_r", "loss_yaw"), ("Y_r", "Y_ur")])
def test_separation_of_two_linear_effects_is_symmetric(a, b):
    """With a column each it is the sine squared of the angle between them."""
    rivals = Rivals(RUNS, False)
    one, other = (flat(over(RUNS, {EFFECTS[e].coefficients[0]: 1.0})) for e in (a, b))
    assert rivals.left(one, b) == pytest.approx(rivals.left(other, a), abs=1e-9)
    assert rivals.left(-3.0 * one, b) == pytest.approx(rivals.left(one, b))


def test_drag_and_bias_are_one_at_constant_speed():
    steady = motion(sailed(), {})
    steady.nu[:, 0] = 0.1
    rivals = Rivals([steady], False)
    assert rivals.left(flat(over([steady], {"delta_X_u": -1.0})), "body_bias") < 1e-9
    assert Rivals(RUNS, False).left(flat(over(RUNS, {"delta_X_u": -1.0})), "body_bias") > 0.1


@pytest.fixture
def short(ships, tmp_path, monkeypatch):
    """Runs of 100 s in place of 240 s, and a folder of FMUs that keeps them."""
    for fmu in ships.glob("*.fmu"):
        shutil.copy(fmu, tmp_path)
    monkeypatch.setattr(simulated_runs, "STOP", 100.0)
    return tmp_path


FLEET = [
    Hidden({"V_n": 0.02, "m": 15.0}, {"deadband": 0.05, "delay": 0.13, "lag": 0.3}, clock=0.1),
    Hidden({"drag_1_5": 1.0}, {"bow_exp": 3.0}, other=True),
]


@pytest.mark.slow
def test_fleet_sails_as_single_ships_do_in_cosimulation(short, monkeypatch):
    """To rounding, noise, freezes, spikes and all; only the acceleration at the start is before any force."""
    for module in (simulated_runs, fleet):
        monkeypatch.setattr(module, "STOP", 22.0)
    orders = [Order(manoeuvres(0)[k % 3], hidden, 1.0, k) for k, hidden in enumerate(FLEET)]
    for order, together in zip(orders, sail_all(orders), strict=True):
        alone = sail(order.manoeuvre, order.hidden, order.noise, order.seed, short)
        assert isinstance(together, Voyage)
        for name in ("eta", "nu", "tau", "omega"):
            assert getattr(together, name) == pytest.approx(getattr(alone, name), abs=1e-9)
        assert together.nu_dot[1:] == pytest.approx(alone.nu_dot[1:], abs=1e-9)
        assert together.measured.pose == pytest.approx(alone.measured.pose, abs=1e-9)
        assert together.measured.tau_cmd == pytest.approx(alone.measured.tau_cmd, abs=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize(
    "values",
    [
        {"delta_X_u": -1.0}, {"mass": 4.0}, {"loss_yaw": 0.3}, {"lag": 0.3}, {"delay": 0.3}, {"V_n": 0.03},
    ],
    ids=lambda values: next(iter(values)),
)  # fmt: skip
def test_force_is_that_of_the_simulation(short, values):
    """Two ways to the same: the log of the simulation, and the effect on the true motion."""
    ship = {n: x for n, x in values.items() if n in ("delta_X_u", "mass", "V_n")}
    machine = {n: x for n, x in values.items() if n not in ship}
    v = sail(manoeuvres(0)[2], Hidden(ship, machine), 1.0, 1, short)
    m = motion(v, {})
    logged, found = windows(v.omega + v.tau - m.tau), windows(force(m, values))
    assert np.abs(found - logged).max() < 0.02 * np.abs(logged).max()


@pytest.mark.slow
def test_ships_of_another_form_run(short):
    laws = {"drag |u|^1.5": {"drag_1_5": 1.0}, "bow exp(-(u/u0)^2)": {"bow_exp": 3.0}}
    hidden = Hidden(laws["drag |u|^1.5"], laws["bow exp(-(u/u0)^2)"] | {"delay": 0.135}, other=True)
    assert manoeuvres(0)[0].kind == "ellipse"
    v = sail(manoeuvres(0)[0], hidden, 1.0, 1, short)
    logged = windows(v.omega)
    found = added_force([motion(v, {})], "drag |u|^1.5", laws["drag |u|^1.5"])
    assert np.abs(found[:, 0] - logged[:, 0]).max() < 0.02 * np.abs(logged[:, 0]).max()


@pytest.mark.slow
def test_manoeuvres_start_where_they_are(ships):
    for m in manoeuvres(3):
        assert isinstance(m, Manoeuvre)
        v = sail(m, Hidden(), 1.0, 0, ships)
        assert np.hypot(*(v.eta[0, :2] - v.measured.pose[0, :2])) < 0.02
        assert 0.08 < np.abs(v.nu[:, :2]).max() < 0.25


def test_rows_survive_an_interruption(tmp_path):
    row = Row(
        "X_|u|u", "n1", "exact", 0, found=["X_u", "lag"], alike=["", "X_u"], right=True, after_mm=1.5
    )
    Results(tmp_path / "r.csv").add(row)
    with (tmp_path / "r.csv").open("a") as file:
        file.write("X_u,n1,ex")
    again = Results(tmp_path / "r.csv")
    assert again.done == {row.key}
    assert again.rows[0].found == row.found
    assert again.rows[0].right is True
    assert again.rows[0].after_mm == 1.5
    assert Results(tmp_path / "r.csv").done == {row.key}


def test_table_of_another_version_is_refused(tmp_path):
    (tmp_path / "r.csv").write_text("effect,noise\n")
    with pytest.raises(InputError, match="another version"):
        Results(tmp_path / "r.csv")


def test_summary_counts(tmp_path):
    good = Row(
        "X_u", "n1", "exact", 0, found=["X_u"], reported=["X_u"], separable=True, right=True, in_set=True
    )
    bad = Row("N_r", "n1", "exact", 0, found=["lag"], reported=["lag"], separable=True)
    text = write(tmp_path, [good, bad, Row("none", "n1", "wrong", 0)]).read_text()
    assert (
        "| right effect first where separable, exact | >= 97 % | 50.0 % (1/2): n1 50.0 % (1/2) |" in text
    )
    assert "| false finding where nothing is hidden | <= 2 % | 0.0 % (0/1) |" in text
    assert "| N_r | 0/1 | 0/1 | - | lag 1x |" in text


def test_unknown_effect_names_the_nearest(tmp_path, capsys):
    assert main(["--effects", "X_uv", "--out", str(tmp_path)]) == 2
    assert "did you mean" in capsys.readouterr().err


HIDDEN = Cell(("loss_yaw",), "n4", False, 0)


@pytest.fixture(scope="module")
def simulated(shared):
    """Folder of a problem, of runs of 40 s."""

    def simulate(folder):
        with pytest.MonkeyPatch.context() as patch:
            for module in (simulated_runs, fleet):
                patch.setattr(module, "STOP", 40.0)
            assert list(make([HIDDEN], folder)) == [HIDDEN.key]

    return once(shared / "hidden_problems", simulate)


@pytest.mark.slow
def test_diagnosis_gets_a_measurement_and_nothing_else(simulated):
    problem = kept(HIDDEN.key, simulated)
    assert len(problem.runs) == 4
    for run in problem.runs:
        known = {name for name, value in vars(run).items() if value is not None}
        empty = {"absent", "measured", "noise", "left_out"}
        given = {"name", "time", "pose", "tau_cmd", "notes", "signals", "hashes", "layout"}
        assert known == given | empty
        assert not any(getattr(run, name) for name in empty)
        assert run.pose.shape == run.tau_cmd.shape == (2001, 3)
    frozen = [(np.diff(run.pose[:, 0]) == 0.0).any() for run in problem.runs]
    assert any(frozen), "there are freezes"


@pytest.mark.slow
def test_what_is_hidden_is_found(simulated, tmp_path):
    judge(HIDDEN.key, simulated, tmp_path, False)
    found = scored(HIDDEN.key, simulated, tmp_path)
    assert found.found[:1] == list(HIDDEN.effects)
    assert found.right
    assert found.true[0] == "1"
    assert found.fall > 3.0
    assert found.intervals == 1


def problem_of(effect, coefficients="exact", values=None, alike=((),)):
    hidden = [Draw(e, (values or {}), 0.2) for e in effect.split(" + ") if e != "none"]
    return Problem(effect, "n1", coefficients, 1, hidden, 0, list(alike) * len(hidden))


def answer_of(verdict, *effects, significant=False, suspects=()):
    """An answer with effects (id, confidence, coefficients)."""
    stated = [
        {"id": e, "confidence": c, "indistinguishable": [], "coefficients": k} for e, c, k in effects
    ]
    error = {"held_out": True, "window_position_rmse": {"before": 0.1, "after": 0.01}}
    return {
        "verdict": verdict,
        "effects": stated,
        "suspect_coefficients": [{"name": n} for n in suspects],
        "remainder": {"significant": significant},
        "errors": [error],
        "truth_mm": 9.0,
        "seconds": 1.0,
    }


def test_score_of_right_and_wrong_findings():
    c = {"delta_X_u": {"value": -1.0, "ci95": [-1.2, -0.8]}}
    found = row(
        problem_of("X_u", values={"delta_X_u": -1.1}),
        answer_of("found", ("X_u", 0.98, c), ("lag", 0.7, {})),
    )
    assert (found.right, found.true, found.confidences) == (True, ["1", "0"], ["0.98", "0.7"])
    assert (found.intervals, found.covered, found.surest) == (1, 1, 0.7)
    assert found.reached == pytest.approx(0.9)
    outside = row(problem_of("X_u", values={"delta_X_u": -2.0}), answer_of("found", ("X_u", 0.98, c)))
    assert (outside.intervals, outside.covered) == (1, 0)


def test_process_noise_has_the_size_and_the_time_that_it_says():
    noise = ProcessNoise((0.1, 0.2, 0.02), 2.0)
    series = noise.series(np.random.default_rng(1), 200_000)
    assert series.std(axis=0) == pytest.approx(noise.size, rel=0.1)
    later = round(2.0 / STEP)
    kept = np.mean(series[:-later] * series[later:], axis=0) / series.var(axis=0)
    assert kept == pytest.approx(np.exp(-1.0), abs=0.1)


def test_damping_of_one_ship_counts_as_one():
    """Its coefficients are off together: three of each say no more than one, and the error stays."""
    off = np.random.default_rng(2).standard_normal(12)

    def stated(of_each):
        return bias([Row("N_r", "n1", "wrong", 0, damping=[str(z)] * of_each) for z in off])

    assert stated(1) == stated(3)
    assert stated(1).endswith("(12 ships)")
    assert mean_and_error([-1.0, 1.0]) == pytest.approx((0.0, 1.0))
    assert mean_and_error(4 * [2.0]) == pytest.approx((2.0, 0.0))


def test_in_process_noise_every_interval_counts_and_damping_by_its_sum():
    problem = problem_of("X_u" + IN_NOISE, "wrong", {"delta_X_u": -1.0})
    problem = replace(problem, vessel={"delta_X_u": -1.0, "X_u": -0.7}, thrusters={})
    names = ["delta_X_u", "X_u", "m", "loss_yaw"]
    mean = [-1.5, -0.2, Model().value("m") + 1.0, 0.0]  # the sum is right, each alone is not
    covariance = np.diag([0.01, 0.01, 1.0, 0.01])
    answer = answer_of("found", ("X_u", 0.98, {})) | {"posterior": [names, mean, covariance.tolist()]}
    found = row(problem, answer)
    assert (found.intervals, found.covered, found.true) == (4, 2, ["1"])
    assert list(map(float, found.damping)) == pytest.approx([0.0], abs=1e-9)
    assert row(problem_of(NOTHING_HIDDEN + IN_NOISE), answer).true == ["0"]


def test_coefficient_that_is_told_counts_where_it_is_the_same_as_the_effect():
    assert same_coefficients("X_|u|u") == {"X_absu_u"}
    assert same_coefficients("loss_bow") == {"plant_F_bow"}
    assert same_coefficients("X_rr") == same_coefficients("current") == set(), "nominally zero"
    stated = answer_of("coefficients", suspects=["N_r"])
    assert row(problem_of("N_r", "wrong"), stated).right
    assert not row(problem_of("Y_r", "wrong"), stated).right


@pytest.mark.parametrize("effect", UNKNOWN)
def test_nothing_that_is_named_is_a_cause_of_foreign_physics(effect, tmp_path):
    wrong = row(problem_of(effect), answer_of("found", ("X_u", 0.95, {}), significant=True))
    doubt = row(problem_of(effect), answer_of("found", ("X_u", 0.5, {}), significant=True))
    assert (wrong.right, wrong.true, wrong.surest) == (False, ["0"], 0.95)
    text = write(tmp_path, [wrong, doubt]).read_text()
    assert (
        "| foreign physics: reported as unexplained, nothing wrong at >= 0.9 | >= 95 % | 50.0 % (1/2)"
        in text
    )


def test_bins_hold_enough_and_cover_all():
    rng = np.random.default_rng(0)
    stated = [Told(float(c), bool(rng.random() < c)) for c in rng.beta(4.0, 0.5, 700)]
    found = bins(stated)
    assert len(found) > 3
    assert sum(b.count for b in found) == 700
    assert min(b.count for b in found) >= 50
    assert sum(b.calibrated for b in found) >= len(found) - 1
    assert len(bins(stated[:30])) == 1


@pytest.mark.parametrize(
    ("right", "low", "high"), [(0, 0.0, 0.3085), (5, 0.1871, 0.8129), (10, 0.6915, 1.0)]
)
def test_binomial_interval_is_that_of_the_tables(right, low, high):
    assert interval(right, 10) == pytest.approx((low, high), abs=1e-4)


def test_calibration_finds_the_constants_that_made_the_findings():
    """Findings drawn by known constants: their confidences come back, to what the sample tells."""
    rng, known = np.random.default_rng(1), (3.0, 6.0)
    bagged, left, varies = (
        rng.uniform(0.7, 1.0, 4000),
        rng.uniform(0, 0.7, 4000),
        rng.uniform(0, 0.5, 4000),
    )
    rate = confidence(bagged, left, varies, known)
    true = rng.random(4000) < rate
    table = zip(bagged.tolist(), left.tolist(), varies.tolist(), true.tolist(), strict=True)
    found = fitted([Judged(b, x, y, t) for b, x, y, t in table])
    assert confidence(bagged, left, varies, found) == pytest.approx(rate, abs=0.05)
    none_wrong = fitted([Judged(1.0, 0.0, 0.0, True)] * 50)
    assert 0.9 < confidence(np.ones(1), np.zeros(1), np.zeros(1), none_wrong)[0] < 0.99


def test_diagram_shows_only_cells_that_nothing_was_fitted_to(tmp_path):
    rows = [
        Row(e, "n1", "exact", seed, found=["X_u"], confidences=["0.9"], true=["1"])
        for e in (SINGLE[0], SINGLE[1], "none")
        for seed in (3, 60)
    ]
    assert {kind: some[0].count for kind, some in tables(rows).items()} == {
        "all": 2,
        "single": 1,
        "none": 1,
    }
    draw_diagram(rows, tmp_path / "reliability.png")
    assert (tmp_path / "reliability.png").read_bytes().startswith(b"\x89PNG")
    draw_diagram([], tmp_path / "nothing.png")


def test_too_little_to_calibrate_is_refused(tmp_path, capsys):
    Results(tmp_path / "results.csv").add(Row("X_u", "n1", "exact", 60))
    assert (
        main(
            [
                "--effects",
                "X_u",
                "--noise",
                "n1",
                "--exact",
                "--first",
                "60",
                "--calibrate",
                "--out",
                str(tmp_path),
            ]
        )
        == 2
    )
    assert "50 are needed" in capsys.readouterr().err


@pytest.mark.parametrize("effect", OUTAGES)
def test_outages_at_other_times_in_each_run_are_scored_run_by_run(effect):
    rng, still = np.random.default_rng(3), np.zeros((3000, 3))
    t = np.arange(3000) * 0.08
    command = np.column_stack([np.sin(0.3 * t), np.sin(0.4 * t), np.sin(0.5 * t)])
    drawn = draw(effect, rng, [Motion(t, still, still, still, command)] * 3)
    own = [tuple(drawn.during(f"run{k}").values.values()) for k in (1, 2, 3, 4)]
    assert len(set(own)) == 4
    assert drawn.size > 0.1
    stated = {
        name.removesuffix("@run1"): {"value": t + 0.3, "ci95": [t + 0.2, t + 0.4], "run": name[-4:]}
        for name, t in drawn.values.items()
        if not name.endswith("run4")
    }
    problem = Problem(effect, "n1", "exact", 1, [drawn])
    answer = answer_of("found", (effect.removesuffix(OTHER_TIMES), 0.98, stated))
    assert row(problem, answer).right
    (name, one), *_ = stated.items()
    late = {"value": one["value"] + 1.0, "ci95": [one["value"] + 0.9, one["value"] + 1.1]}
    for wrong in (stated | {name: one | late}, {n: c for n, c in stated.items() if c["run"] != "run2"}):
        assert not row(problem, answer_of("found", (effect.split()[0], 0.98, wrong))).right
