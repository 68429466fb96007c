"""The study of chapter 6: what is hidden in the plant, what is measured, and what is made of it."""

import json

import numpy as np
import pytest

import cosim
from cosim.dispatch import FinishedRun
from diagnosis import Model
from diagnosis.model import write_model
from fmus.hull import RotationalDamping
from fmus.vessel import vessel
from studies import chapter6
from studies.basin_trials import (
    causes,
    chapter6_runs,
    lessons,
    margin,
    observations,
    store_contents,
    sysid4,
    trials,
)
from studies.basin_trials.found import FAULTY, REGULAR, Found, share
from studies.monte_carlo import shipped, vary
from studies.observers.estimates_replayed import parameters
from studies.tracking.outcome import missing, quick

SLOW = trials.TRIALS[0]


def run(content, folder):
    result = cosim.simulate(cosim.load_scenario(content), folder)
    assert result.status == "done", result.message
    return cosim.read_log(folder)


def test_plant_has_the_coefficients_of_table_7_1():
    named = sysid4.parameters()
    own = {k.removeprefix("vessel."): x for k, x in named.items() if k.startswith("vessel.")}
    damping = vessel.COMPONENT.prepare(parameters(vessel.COMPONENT, own)).hull.damping
    assert damping.rotational == pytest.approx(
        RotationalDamping(-0.014, 1.55, 0.017, 0.2, 0.017, -1.8, -0.02, -0.2)
    )
    assert damping.towed.X_u == pytest.approx(-0.6555 - 3.5)
    assert damping.towed.X_absu_u == pytest.approx(0.3545 - 0.26)
    assert damping.extra.X_absu_r == pytest.approx(0.2)
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


@pytest.mark.parametrize("name", ["controller_cl_svd_eps", "controller_cl_win_z2"])
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
    zero = trials.Sailed(*[0.0] * 17)
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
    return Found(table, {}, {}, {}, {})


def test_lost_runs_are_left_out_of_pairs():
    a = [sailed(position=0.5), sailed(position=9.0, lost=1.0), sailed(position=0.5)]
    b = [sailed(), sailed(), sailed()]
    assert share(a, b).mean == pytest.approx(2.0)


def test_fault_that_costs_nothing_is_no_lesson():
    worse = {c: {"position": 0.5, "lag": -0.49} for c in trials.CONTROLLERS}
    assert lessons.guidance(made_up(faulty=worse)).here == "reproduced"
    better = {c: {"position": 0.1} for c in trials.CONTROLLERS}
    assert lessons.guidance(made_up(faulty=better)).here == "reversed"
    assert lessons.guidance(made_up()).here == "undecided"


def test_adaptation_in_surge_would_be_seen():
    assert lessons.no_surge(made_up()).here == "reproduced"
    learning = made_up({trials.CLE: {"omega_hat_X": 0.2}})
    assert lessons.no_surge(learning).here == "not reproduced"
    falling = made_up({trials.CLZ: {"lag": -0.1}})
    assert lessons.no_surge(falling).here == "not reproduced"


def test_adaptive_backstepping_that_is_far_better_would_be_seen():
    assert lessons.adaptive(made_up()).here.startswith("reproduced")
    better = {trials.ABS: {"position": 0.1}}
    assert lessons.adaptive(made_up(better, better)).here.startswith("in 0 of 8")
    assert "Fell behind for good: none." in lessons.adaptive(made_up()).numbers
    fell = lessons.adaptive(made_up(faulty={trials.RBS: {"lost": 1.0}})).numbers
    assert "ellipse 0.08, fault: 5 of RBS and 0 of ABS" in fell


def test_those_who_fall_behind_are_told():
    fast = {c: {"lost": 1.0} for c in (trials.CLZ, trials.CLE)}
    assert lessons.fallen(made_up(faulty=fast)).here == "reproduced"
    assert lessons.fallen(made_up(fast)).here == "not reproduced", (
        "in the basin the guidance had its fault"
    )
    assert lessons.fallen(made_up(fast, {**fast, trials.RBS: {"lost": 1.0}})).here == "not reproduced"


def test_observations_of_the_swift_ellipse():
    worse, swings, failing, improving, *_ = observations.observations(made_up())
    for calm in (worse, swings, failing, improving):
        assert calm.here.endswith("without: no"), calm.thesis
    fast = trials.TRIALS[2].name
    found = made_up({trials.ABS: {"position": 0.2}})
    runs = {
        c: [r._replace(lost=1.0) for r in found.trials[fast, REGULAR][c]]
        for c in (trials.CLZ, trials.CLE)
    }
    found.trials[fast, REGULAR].update(runs)
    _, _, failing, improving, *_ = observations.observations(found)
    assert failing.here.endswith("without: yes")
    assert improving.here.endswith("without: yes")
    found.trials[fast, FAULTY].update({trials.RBS: [sailed(lost=1.0)] * 5})
    assert "with the fault: no run kept up" in observations.observations(found)[3].here


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

    assert verdict(30.0, 3.0).here == "reproduced"
    assert "CLE 0.3 [0.3, 0.3] without spikes" in verdict(30.0, 3.0).numbers
    assert verdict(3.0, 3.0).here == "reversed"


@pytest.mark.slow
@pytest.mark.timeout(900)
@pytest.mark.usefixtures("serial")
def test_whole_study_in_small(tmp_path, monkeypatch):
    draw, sets = chapter6.draw, {}

    def one_set(logs, folder, told):
        """Of the four sets of pictures, which differ by their data alone, the first is drawn."""
        sets[folder.relative_to(tmp_path).as_posix()] = (
            [path.name for path in draw(logs, folder, told)] if not sets else []
        )

    monkeypatch.setattr(chapter6, "draw", one_set)
    report = chapter6.study(tmp_path, range(1), 0.02, None, None)
    text = report.read_text()
    results = json.loads((tmp_path / "results.json").read_text())
    assert len(results["lessons"]) == 10
    assert len(results["observations"]) == 6
    assert {len(r) for r in results["trials"].values()} == {4}
    assert len(results["trials"]) == 8
    surge = [
        run["omega_hat_X"] for r in results["trials"].values() for each in r.values() for run in each
    ]
    assert set(surge) == {0.0}
    pictures = [line.split("](")[1].rstrip(")") for line in text.splitlines() if line.startswith("![")]
    assert len(pictures) == 20
    assert len(sets) == 4
    drawn, names = next(iter(sets.items()))
    assert len(names) == 5
    for folder in sets:
        assert {f"{folder}/{name}" for name in names} <= set(pictures)
    for name in names:
        picture = tmp_path / drawn / name
        assert picture.read_bytes().startswith(b"\x89PNG")
        assert picture.stat().st_size > 10_000
