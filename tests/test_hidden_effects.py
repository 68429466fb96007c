"""The benchmark of hidden effects: what it hides, what the diagnosis gets, what counts as separable."""

import shutil

import numpy as np
import pytest
from support.shared import once

from benchmarks.hidden_effects import cell as benchmark_cell
from benchmarks.hidden_effects import simulated_runs
from benchmarks.hidden_effects.__main__ import cells, main
from benchmarks.hidden_effects.cell import Cell, trial
from benchmarks.hidden_effects.draw import LARGEST, SINGLE, SMALLEST, added_force, draw, share
from benchmarks.hidden_effects.manoeuvres import Manoeuvre, manoeuvres
from benchmarks.hidden_effects.results import Results, Row
from benchmarks.hidden_effects.separation import NOTHING, Rivals, flat
from benchmarks.hidden_effects.simulated_runs import STEP, Hidden, Voyage, build, sail
from benchmarks.hidden_effects.summary import write
from benchmarks.hidden_effects.truth import force, motion, over, windows
from cosim import InputError
from diagnosis import Run
from fmus.effects import EACH_VSP, STANDARD
from fmus.thrusters.allocation import Allocation, thrust


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
    return Voyage(Run("made", t, eta, tau), eta, nu, nu_dot, tau, 0.0 * tau)


VOYAGE = sailed()
RUNS = [motion(VOYAGE, {}), motion(sailed(speed=0.5, ahead=0.0), {})]


@pytest.fixture(scope="module")
def ships(shared):
    """Folder of the FMUs, and of the runs without anything hidden that the benchmark keeps beside them."""
    return once(shared / "hidden_effects", build)


@pytest.mark.parametrize(
    "effect", [e for e in SINGLE if e not in ("bow_failure", "bow_outage", "vsp_outage")]
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
    hidden = {e for cell in cells(SINGLE, ["n1"], [False, True], range(2)) for e in cell.effects}
    assert {e.id for e in STANDARD.values() if EACH_VSP not in e.needs} <= hidden
    keys = [cell.key for cell in cells(SINGLE, ["n1", "n10"], [False, True], range(2))]
    assert len(set(keys)) == len(keys)


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
    one, other = (flat(over(RUNS, {STANDARD[e].coefficients[0]: 1.0})) for e in (a, b))
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


@pytest.mark.slow
def test_diagnosis_gets_a_measurement_and_nothing_else(short, monkeypatch):
    class Enough(Exception):  # noqa: N818 - no error: there is no need to go on
        pass

    def look(*given):
        raise Enough(*given)

    monkeypatch.setattr(benchmark_cell, "answer", look)
    with pytest.raises(Enough) as raised:
        trial(Cell(("X_u",), "n1", True, 0), short, False)
    train, held_out, prior = raised.value.args
    assert prior == 0.1
    for run in (*train, held_out):
        known = {name: value for name, value in vars(run).items() if value is not None}
        assert set(known) == {"name", "time", "pose", "tau_cmd", "notes"}
        assert run.pose.shape == run.tau_cmd.shape == (5001, 3)
        assert (np.diff(run.pose[:, 0]) == 0.0).any(), "there are freezes"
    assert len(train) == 3


@pytest.mark.parametrize(
    "values",
    [
        pytest.param(values, id=next(iter(values)), marks=() if "delay" in values else pytest.mark.slow)
        for values in (
            {"delta_X_u": -1.0}, {"mass": 4.0}, {"loss_yaw": 0.3}, {"lag": 0.3}, {"delay": 0.3}, {"V_n": 0.03},
        )
    ],
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
    text = write(tmp_path, [good, bad, Row("none", "n1", "wrong", 0)], None).read_text()
    assert "| right effect first where separable, exact, n1 and n4 | >= 97 % | 50.0 % (1/2) |" in text
    assert "| false finding, wrong | <= 3 % | 0.0 % (0/1) |" in text
    assert "| N_r | 0/1 | 0/1 | - | lag 1x |" in text


def test_unknown_effect_names_the_nearest(tmp_path, capsys):
    assert main(["--effects", "X_uv", "--out", str(tmp_path)]) == 2
    assert "did you mean" in capsys.readouterr().err


@pytest.mark.slow
@pytest.mark.parametrize("effect", ["loss_yaw", "N_r"])
def test_hidden_effect_is_found(ships, effect):
    row = trial(Cell((effect,), "n4", False, 0), ships, False)
    assert row.in_set
    assert row.right or not row.separable
    assert row.fall > 5.0


@pytest.mark.slow
def test_nothing_is_found_where_nothing_is_hidden(ships):
    assert trial(Cell((), "n4", False, 0), ships, False).found == []
