"""The study of chapter 6: what is hidden in the plant, what is measured, and what is made of it."""

import json

import numpy as np
import pytest
from support.cse1 import VESSEL

import cosim
from cosim.dispatch import FinishedRun
from diagnosis import Model
from diagnosis.predictors import write_model
from fmus.hull import RotationalDamping
from thesis import chapter6
from thesis.basin_trials import (
    causes,
    chapter6_runs,
    lessons,
    margin,
    observations,
    store_contents,
    sysid4,
    trials,
)
from thesis.basin_trials.found import FAULTY, FRESH, PRINTED, REGULAR, TrialRuns, share
from thesis.monte_carlo import SampleMean, shipped, vary
from thesis.observers.estimates_replayed import parameters
from thesis.tracking.outcome import missing, quick

SLOW = trials.TRIALS[0]
BLOCKED_FRESH = f"{FRESH}, blocker"


def run(content, folder):
    result = cosim.simulate(cosim.load_scenario(content), folder)
    assert result.status == "done", result.message
    return cosim.read_log(folder)


def test_plant_has_the_coefficients_of_table_7_1():
    named = sysid4.parameters()
    own = {k.removeprefix("vessel."): x for k, x in named.items() if k.startswith("vessel.")}
    damping = VESSEL.prepare(parameters(VESSEL, own)).hull.damping
    assert [getattr(damping.terms, n) for n in RotationalDamping._fields] == pytest.approx(
        RotationalDamping(-0.014, 1.55, 0.017, 0.2, 0.017, -1.8, -0.02, -0.2)
    )
    assert damping.terms.X_u == pytest.approx(-0.6555 - 3.5)
    assert damping.terms.X_absu_u == pytest.approx(0.3545 - 0.26)
    assert damping.terms.X_absu_r == pytest.approx(0.2)
    assert [named[f"thrusters.loss_{a}"] for a in ("surge", "sway", "yaw")] == [0.3, 0.0, 0.31]


def test_lost_thrust_is_part_of_the_missing_force(tmp_path):
    content = vary(
        shipped("ellipse"),
        {"controller": "controller_bs.fmu"},
        {"thrusters.loss_surge": 0.3},
        stop=8.0,
        faults=[],
        metrics={},
    )
    log = run(content, tmp_path)
    late = log["time"] > 5.0
    commanded = log["thrusters.tau_cmd_X"][late]
    assert np.abs(log["vessel.omega_star_X"]).max() < 1e-9, "the hull has no error of its own"
    assert np.abs(commanded).min() > 0.01
    assert missing(log, "X")[late] == pytest.approx(-0.3 * commanded, rel=1e-6)


@pytest.mark.parametrize("trial", trials.TRIALS, ids=lambda t: t.name)
def test_fault_leaves_the_true_speed_and_quarters_the_stated_one(trial, tmp_path):
    speeds, stated = {}, {}
    for faulty in (False, True):
        content = trials.scenario(trial._replace(seconds=4.0), trials.RBS, faulty)
        content["log"] = {"signals": ["guidance.*"]}
        log = run(vary(content, metrics={}), tmp_path / str(faulty))
        way = np.hypot(np.diff(log["guidance.x_t"]), np.diff(log["guidance.y_t"]))
        speeds[faulty] = way.sum() / log["time"][-1]
        stated[faulty] = np.hypot(log["guidance.x_t_dot"], log["guidance.y_t_dot"]).mean()
    assert speeds[True] == pytest.approx(speeds[False], rel=1e-3)
    assert stated[False] == pytest.approx(speeds[False], rel=1e-2)
    assert stated[True] == pytest.approx(0.25 * speeds[True], rel=1e-2)


@pytest.mark.parametrize("sense", [1.0, -1.0])
@pytest.mark.parametrize("radius", [0.9, 1.15])
def test_inside_is_what_a_circle_is_smaller_by(sense, radius):
    angle = np.linspace(0.0, 4.0 * np.pi, 2001)
    behind = angle - 0.3
    log = {
        "guidance.x_t": np.cos(angle),
        "guidance.y_t": sense * np.sin(angle),
        "guidance.psi_t": np.angle(np.exp(1j * (sense * (angle + 0.5 * np.pi)))),
        "vessel.x": radius * np.cos(behind),
        "vessel.y": sense * radius * np.sin(behind),
    }
    assert trials.inside(log, angle > 1.0) == pytest.approx(1.0 - radius, abs=1e-3)


def test_quick_part_is_without_what_is_slow_even_at_the_ends():
    t = np.arange(0.0, 60.0, 0.01)
    slow, fast = np.sin(0.1 * t), 0.01 * np.sin(2.0 * np.pi * 3.0 * t)
    left = quick(slow + fast, 0.01)
    far = slice(300, -300)
    assert left[far] == pytest.approx(fast[far], abs=1e-3)
    assert left == pytest.approx(fast, abs=0.01), "a moving mean would leave half of the slow part there"


def test_spike_is_distinguished_from_the_end_of_a_freeze():
    t = np.arange(0.0, 10.0, 0.01)
    x = 0.08 * t
    x[300:400] = x[300]
    x[700] += 0.1
    x[800] -= 0.1
    assert store_contents.spike_times({"time": t, "observer.x_m": x}) == pytest.approx([7.0, 8.0])
    assert store_contents.echo(np.array([6.9, 7.0, 7.9, 9.1]), np.array([7.0, 8.0])).tolist() == [
        False,
        True,
        True,
        False,
    ]


@pytest.mark.parametrize("name", ["controller_cl_win_z2"])
def test_replayed_controller_stores_what_it_stored_in_the_run(name, tmp_path):
    content = trials.scenario(SLOW._replace(seconds=12.0), name, parameters=chapter6_runs.OPEN)
    spikes = {**trials.SPIKES, "at": [8.0]}
    del spikes["rate"]
    faults = [f for f in content["faults"] if f["kind"] != "spikes"] + [spikes]
    content = vary(content, faults=faults, log={"signals": store_contents.logged(f"{name}.fmu")})
    result = cosim.simulate(cosim.load_scenario(content), tmp_path)
    log = cosim.read_log(tmp_path)
    values = json.loads((tmp_path / "log.json").read_text())["scenario"]["fmus"]["controller"]
    sigma, _ = store_contents.replayed(
        store_contents.controller(f"{name}.fmu"), log, values["parameters"]
    )
    assert sigma[-1] > 0.0
    assert sigma == pytest.approx(log["controller.sigma_min"], rel=1e-9, abs=1e-12)
    held = store_contents.store_contents(FinishedRun(content, log=log, metrics=result.metrics))
    assert held.spikes == 1.0
    assert held.time == pytest.approx(1.0 / 12.0, rel=0.02)
    assert 0.0 <= held.stored <= 1.0


@pytest.mark.parametrize("axis", [(2.76, 0.2, 1.0), (2.76, 0.2, 3.0), (24.8, 1.2, 12.0)])
def test_delay_margin_parts_decay_from_growth(axis):
    T, _ = margin.margin(*axis)
    assert growth(*axis, 0.9 * T) < 1.0 < growth(*axis, 1.1 * T)


def growth(m, K_p, K_d, delay, h=0.002):
    """Amplitude late over amplitude early, of the loop that the margin is about, in time."""
    e, e_dot, seen = 1.0, 0.0, 1.0
    forces = [0.0] * (round(delay / h) + 1)
    late, early = 0.0, 0.0
    steps = round(60.0 * delay / h)
    for k in range(steps):
        seen_dot = (e - seen) / margin.FILTER
        forces.append(-(1.0 + K_d * K_p) * seen - (K_d + m * K_p) * seen_dot)
        seen += h * seen_dot
        e_dot += h * forces.pop(0) / m
        e += h * e_dot
        early = max(early, abs(e)) if steps // 4 < k < steps // 2 else early
        late = max(late, abs(e)) if k > 3 * steps // 4 else late
    return late / early


def test_swift_gains_bear_less_delay():
    found = margin.margins()
    hard, twice = found["Table 6.4"], found["twice Table 6.4"]
    assert twice[0] < hard[0] < found["Table 5.1"][0]
    assert twice[1] > hard[1]


def sailed(**values):
    zero = trials.Sailed(*[0.0] * 21)
    return zero._replace(
        **{"position": 0.25, "along": 0.25, "lag": -0.25, "first": -0.25, "swing": 0.01} | values
    )


def made_up(regular=None, faulty=None):
    """Runs of all trials that are all alike, but for what is given by controller."""
    rng = np.random.default_rng(0)

    def runs(values):
        position = (values or {}).pop("position", 0.25)
        return [sailed(position=position * (1.0 + 0.01 * rng.random()), **values) for _ in range(5)]

    table = {}
    for trial in trials.TRIALS:
        for fault, given in ((REGULAR, regular), (FAULTY, faulty)):
            table[trial.name, fault] = {
                c: runs(dict((given or {}).get(c, {}))) for c in trials.CONTROLLERS
            }
    return TrialRuns(table, {}, {}, {}, {})


def test_lost_runs_are_left_out_of_pairs():
    a = [sailed(position=0.5), sailed(position=9.0, lost=1.0), sailed(position=0.5)]
    b = [sailed(), sailed(), sailed()]
    assert share(a, b).mean == pytest.approx(2.0)


def test_fault_that_costs_nothing_is_no_lesson():
    worse = {c: {"position": 0.5, "lag": -0.49} for c in trials.CONTROLLERS}
    assert lessons.guidance(made_up(faulty=worse)).holds is True
    better = {c: {"position": 0.1} for c in trials.CONTROLLERS}
    assert lessons.guidance(made_up(faulty=better)).holds is False
    assert lessons.guidance(made_up()).holds is None


def test_adaptation_in_surge_would_be_seen():
    assert lessons.no_surge(made_up()).holds is True
    learning = made_up({trials.CLE: {"omega_hat_X": 0.2}})
    assert lessons.no_surge(learning).holds is False
    falling = made_up({trials.CLZ: {"lag": -0.1}})
    assert lessons.no_surge(falling).holds is False


def test_adaptive_backstepping_that_is_far_better_would_be_seen():
    assert lessons.adaptive(made_up()).holds is True
    better = {trials.ABS: {"position": 0.1}}
    assert lessons.adaptive(made_up(better, better)).holds is False
    assert "Fell behind for good: none." in lessons.adaptive(made_up()).numbers
    fell = lessons.adaptive(made_up(faulty={trials.RBS: {"lost": 1.0}}))
    assert "ellipse 0.08, fault: 5 of RBS and 0 of ABS" in fell.numbers
    lost = [setting for setting, same in fell.here.items() if not same]
    assert lost == [f"{t.name}, fault" for t in trials.TRIALS], (
        "a controller that is lost is not as good"
    )


@pytest.mark.parametrize(
    ("ratio", "same"),
    [
        ((1.04, 1.03, 1.05), True),
        ((1.2, 0.9, 1.6), True),
        ((1.2, 1.1, 1.3), False),
        ((0.8, 0.7, 0.9), False),
        ((1.2, 0.0, np.inf), False),
        ((np.nan, 0.0, np.inf), False),
    ],
)
def test_controllers_are_alike_by_their_ratio_or_its_interval(ratio, same):
    assert lessons.alike(SampleMean(*ratio)) is same


def test_those_who_fall_behind_are_told():
    fast = {c: {"lost": 1.0} for c in (trials.CLZ, trials.CLE)}
    assert lessons.fallen(made_up(faulty=fast)).holds is True
    assert lessons.fallen(made_up(fast)).holds is False, "in the basin the guidance had its fault"
    assert lessons.fallen(made_up(fast, {**fast, trials.RBS: {"lost": 1.0}})).holds is False


def test_observations_of_the_swift_ellipse():
    worse, swings, failing, improving, *_ = observations.observations(made_up())
    for calm in (worse, swings, failing, improving):
        assert calm.holds is (None if calm is improving else False), calm.thesis
    fast = trials.TRIALS[2].name
    found = made_up({trials.ABS: {"position": 0.2}})
    runs = {
        c: [r._replace(lost=1.0) for r in found.trials[fast, REGULAR][c]]
        for c in (trials.CLZ, trials.CLE)
    }
    found.trials[fast, REGULAR].update(runs)
    _, _, failing, improving, *_ = observations.observations(found)
    assert failing.here["without"] is True
    assert improving.here["without"] is True
    found.trials[fast, FAULTY].update({trials.RBS: [sailed(lost=1.0)] * 5})
    worse, swings, _, improving, *_ = observations.observations(found)
    assert improving.here["with the fault"] is None
    assert worse.here["with the fault, RBS"] is True, "a ship that is lost tracks worse"
    assert swings.here["with the fault, RBS"] is None, "and its oscillation is not known"


def test_oscillations_have_increased_where_they_grow_more_than_those_of_the_path():
    slow, _, fast, _ = trials.TRIALS
    grown = trials.path_swing(fast) / trials.path_swing(slow)
    assert 10.0 < grown < 40.0, "its harmonics move up into the band"
    found = made_up()
    for factor, said in ((0.9, False), (2.0, True)):
        for each in (REGULAR, FAULTY):
            for name, swing in ((slow.name, 0.001), (fast.name, factor * grown * 0.001)):
                runs = found.trials[name, each]
                runs.update({c: [r._replace(swing=swing) for r in runs[c]] for c in runs})
        swings = observations.observations(found)[1]
        assert swings.holds is said
        assert f"that of the path itself ×{grown:.2g}; limit ×" in swings.numbers


def test_any_ship_may_be_hidden(tmp_path):
    file = tmp_path / "ship.ssv"
    write_model(file, Model().plus({"delta_X_u": -2.0, "loss_bow": 0.2}))
    text, plant = chapter6.hidden(file)
    assert plant == {"vessel.delta_X_u": -2.0, "thrusters.loss_bow": 0.2}
    assert "vessel.delta_X_u = -2" in text
    content = trials.scenario(SLOW, trials.RBS, plant=plant)
    assert "delta_Y_r" not in content["fmus"]["vessel"]["parameters"]
    assert content["fmus"]["thrusters"]["parameters"] == {"loss_bow": 0.2}
    write_model(file, Model())
    with pytest.raises(cosim.InputError, match="no parameter"):
        chapter6.hidden(file)


def test_spikes_are_the_cause_where_they_are():
    def verdict(with_spikes, without):
        given = {c: {"iaew": x} for c, x in ((trials.RBS, 10.0), (trials.ABS, 10.0))}
        cl = {c: {"iaew": with_spikes} for c in (trials.CLZ, trials.CLE)}
        calm = {c: [sailed(iaew=without)] * 5 for c in cl}
        found = made_up(given | cl)._replace(
            eight={("no blocker", False): calm, ("blocker", True): calm}
        )
        return causes.eight(found)

    assert verdict(30.0, 3.0).holds is True
    assert "CLE 0.3 [0.3, 0.3] without spikes" in verdict(30.0, 3.0).numbers
    assert verdict(3.0, 3.0).holds is False


def test_experiments_differ_by_what_they_are_about():
    plant = {"vessel.delta_X_u": -2.0, "thrusters.delay": 0.25}
    trial = SLOW._replace(seconds=40.0)

    def given(content):
        parameters = {i: fmu.get("parameters", {}) for i, fmu in content["fmus"].items()}
        assert parameters["vessel"]["delta_X_u"] == -2.0, "what is hidden, everywhere"
        return parameters, any(fault["kind"] == "spikes" for fault in content["faults"])

    for (name, delay), by_controller in chapter6_runs.delayed(trial, plant).items():
        assert set(by_controller) == {trials.ABS, trials.CLZ}
        for content in by_controller.values():
            parameters, spiky = given(content)
            assert not spiky
            assert content["stop"] == 20.0
            assert parameters["thrusters"]["delay"] == 0.25 + delay
            factor = {"Table 6.4": 1.0, "twice Table 6.4": 2.0}.get(name)
            if factor:
                assert parameters["controller"]["K_d_r"] == factor * trials.HARD["d_r"]
    for (store, spikes), by_controller in chapter6_runs.spiked(trial, plant).items():
        assert set(by_controller) == set(chapter6_runs.CL)
        for name, content in by_controller.items():
            assert content["fmus"]["controller"]["path"] == f"{name}.fmu"
            parameters, spiky = given(content)
            assert spiky == spikes
            assert (parameters["controller"].get("stale", 0.0) == 1.0) == store.startswith(PRINTED)
    for (_, spikes), by_controller in chapter6_runs.slow_eight(trials.TRIALS[1], plant).items():
        assert set(by_controller) == {trials.CLZ, trials.CLE}
        for content in by_controller.values():
            assert given(content)[1] == spikes
            assert "eight" in content["fmus"]["guidance"]["path"]
    for name, content in chapter6_runs.storing(trial, plant).items():
        assert given(content)[1]
        assert content["log"] == {"signals": store_contents.logged(f"{name}.fmu")}


@pytest.mark.parametrize(
    ("hard", "soft", "twice", "here"),
    [
        (0.3, None, 0.1, (True, True)),
        (0.5, 1.0, 0.3, (True, True)),
        (0.0, None, 0.0, (True, True)),
        (1.0, None, 0.5, (False, True)),
        (0.3, 0.5, 0.5, (False, False)),
        (0.3, 0.3, 1.0, (False, False)),
        (None, None, None, (False, False)),
    ],
)
def test_swift_gains_oscillate_from_a_delay_on(hard, soft, twice, here):
    """A controller oscillates from a delay [s] on: four times the swing, or lost."""
    begins = {"Table 6.4": hard, "Table 5.1": soft, "twice Table 6.4": twice}

    def runs(name, delay, each):
        wild = begins[name] is not None and delay >= begins[name]
        lost = float(wild and each == trials.CLZ)
        return [sailed(swing=0.04 if wild else 0.01, lost=lost, frequency=f) for f in (0.1, 0.2, 0.9)]

    delayed = {
        (name, delay): {c: runs(name, delay, c) for c in (trials.ABS, trials.CLZ)}
        for name in begins
        for delay in causes.DELAYS
    }
    found = causes.oscillation(TrialRuns({}, {}, {}, delayed, {}))
    assert tuple(found.here.values()) == here
    assert "Table 5.1, ABS: 0 s ×1 (0.20 Hz)" in found.numbers
    if twice:
        assert f"{twice:g} s ×4 (0.20 Hz)" in found.numbers
        assert f"{twice:g} s ×nan (nan Hz)" in found.numbers


@pytest.mark.parametrize(
    ("with_spikes", "blocked", "stored", "window", "said"),
    [
        (
            0.3,
            0.1,
            0.2,
            5.0,
            [True, True, True, True],
        ),
        (
            0.1,
            0.3,
            0.02,
            50.0,
            [False, False, None, False],
        ),
    ],
)
def test_spikes_are_stored_and_hurt_or_not(with_spikes, blocked, stored, window, said):
    names = [f"controller_cl_{n}" for n in ("svd_eps", "win_eps")]

    def runs(cross_track, lost=0.0):
        return [
            sailed(cross_track=cross_track * (1.0 + 0.01 * k), lost=lost * (k == 2)) for k in range(3)
        ]

    spiked = {(store, False): {c: runs(0.1) for c in names} for store in (FRESH, BLOCKED_FRESH)}
    spiked |= {(FRESH, True): {c: runs(with_spikes) for c in names}}
    spiked |= {(BLOCKED_FRESH, True): {c: runs(blocked) for c in names}}
    spiked |= {(PRINTED, False): {names[0]: runs(0.7), names[1]: runs(1.2)}}
    spiked |= {(PRINTED, True): {c: runs(1.0, lost=1.0) for c in names}}
    kept = store_contents.StoreContents(spikes=2.0, time=0.01, stored=stored, oldest=40.0, gained=0.5)
    stores = {names[0]: [kept, kept._replace(oldest=20.0)], names[1]: [kept._replace(oldest=window)] * 2}
    storing, keeping, spoiling, cured, stale = causes.spikes(TrialRuns({}, spiked, {}, {}, stores))
    assert [v.holds for v in (storing, keeping, spoiling, cured)] == said
    assert "part of the time, 1.0 %" in storing.numbers
    assert (
        f"svd_eps: {100 * stored:.0f} % of the samples, the oldest of them 30 s, and 50 %"
        in storing.numbers
    )
    assert spoiling.printed == {"svd_eps": True, "win_eps": False}, "over 0.7 and 1.2"
    assert stale.holds is True
    assert "svd_eps: 7 [7, 7]; win_eps: 12 [12, 12]" in stale.numbers
    assert f"win_eps {with_spikes / 0.1:.3g} [" in spoiling.numbers
    assert f"({0.101:.3f}→{1.01 * with_spikes:.3f} m)" in spoiling.numbers
    assert "lost 0→1)" in spoiling.numbers


def circling(radius=1.0, behind=0.0, aside=0.0, seconds=100.0, **columns):
    """A run on a circle of radius 5 m to starboard, 0.1 rad/s, the ship behind its target and on another radius."""
    t = np.arange(0.0, seconds, 0.1)
    angle, zero = 0.1 * t, 0.0 * t
    names = [*trials.LOGGED, "vessel.x", "vessel.y", "vessel.psi", "controller.omega_hat_X"]
    log = {"time": t, **dict.fromkeys(names, zero)}
    ship = angle - behind
    log |= {
        "guidance.x_t": 5.0 * np.cos(angle),
        "guidance.y_t": 5.0 * np.sin(angle),
        "guidance.psi_t": angle + np.pi / 2,
    }
    log |= {
        "vessel.x": 5.0 * radius * np.cos(ship),
        "vessel.y": 5.0 * radius * np.sin(ship),
        "vessel.psi": ship + np.pi / 2,
    }
    metrics = {
        "cross_track_rms": 0.1,
        "heading_rms": 0.2,
        "IAE": 3.0,
        "W": 4.0,
        "IAEW": 5.0,
        "IAEWWT": 6.0,
    }
    return FinishedRun(
        {}, log=log | {n.replace("__", "."): x + zero for n, x in columns.items()}, metrics=metrics
    )


def test_numbers_of_a_run_that_is_known():
    t = np.arange(0.0, 100.0, 0.1)
    wave = 0.02 * np.sin(2.0 * np.pi * 0.8 * t)
    run = circling(
        radius=0.9,
        controller__z1_x=np.where(t < 20.0, 9.0, np.where(t < 50.0, -0.2, -0.3)),
        controller__omega_hat_X=np.where(t < 1.0, -0.7, 0.1),
        thrusters__tau_cmd_X=np.where(t < 20.0, 9.0, -2.0),
        thrusters__tau_cmd_Y=np.where(t < 20.0, 9.0, 3.0),
        vessel__r=np.where(t < 18.0, 50.0 * wave, wave),
    )
    found = trials.sailed(run)
    assert found.lost == 0.0
    assert found.position == pytest.approx(0.5)
    assert found.along == pytest.approx(0.0, abs=1e-12)
    assert found.inside == pytest.approx(0.5, abs=1e-3)
    assert (found.cross_track, found.heading) == (0.1, 0.2)
    assert (found.iae, found.work, found.iaew, found.iaewwt) == (3.0, 4.0, 5.0, 6.0)
    assert (found.first, found.lag) == pytest.approx((-0.2, -0.3))
    assert found.omega_X == pytest.approx(2.0, rel=1e-3), (
        "hardly any motion: the ship lacks minus the command"
    )
    assert found.omega_Y == pytest.approx(-3.0, rel=0.05)
    assert found.omega_hat_X == 0.7
    assert found.swing == pytest.approx(0.02 / np.sqrt(2.0), rel=0.05)
    assert found.frequency == pytest.approx(0.8, abs=0.02)


def test_a_ship_that_is_behind_is_so_along_itself_and_lost_from_two_metres_on():
    found = trials.sailed(circling(behind=0.1))
    assert found.position == pytest.approx(10.0 * np.sin(0.05))
    assert found.along == pytest.approx(5.0 * np.sin(0.1))
    assert found.inside == pytest.approx(0.0, abs=1e-3)
    assert found.lost == 0.0
    assert trials.sailed(circling(behind=2.0 * np.arcsin(0.201))).lost == 1.0
    assert trials.sailed(circling(behind=2.0 * np.arcsin(0.199))).lost == 0.0
    broken = trials.sailed(FinishedRun({}, status="failed"))
    assert broken.lost == 1.0
    assert np.isnan(broken[1:]).all()
    short = trials.sailed(circling(seconds=10.0, controller__z1_x=2.0))
    assert np.isnan(short.first), "it settles until the second half"
    assert short.lag == 2.0
