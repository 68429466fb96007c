"""The table of methods: windows are the project's, what is left out stays left out, others can join."""

import json
import sys
from dataclasses import replace
from functools import cache
from importlib import import_module
from types import SimpleNamespace

import numpy as np
import pytest
from support.cse1 import THREE
from support.measured import DATA, needs_data, sail

import diagnosis
from benchmarks.ships import __main__ as ships
from benchmarks.ships import simulated_otter
from benchmarks.ships.chosen_settings import searched
from benchmarks.ships.datasets import DATASETS, digest_of
from benchmarks.ships.entry_predictor import OfLaw, OfModel, Score, Training, score, spread
from benchmarks.ships.same_windows import Continuous, Nominal, law_errors, moved, table
from cosim import InputError
from diagnosis import Model, Run
from diagnosis.predictors.thrust import commanded_shares

LENGTH = 8.0
DAMPED = np.array([[-0.2, 0.0, 0.0], [0.0, -0.3, 0.05], [0.0, 0.1, -0.5]])
PUSHED = np.array([[0.05, 0.0, 0.0], [0.0, 0.03, 0.01], [0.0, 0.02, 0.2]])


def linear(nu, given):
    return nu @ DAMPED.T + given @ PUSHED.T


class Ignorant:
    """Knows of no force, and takes commands for forces."""

    def inputs(self, kind, nu, given):
        return given

    def acceleration(self, nu, given):
        return np.zeros_like(nu)


@cache
def toy(seed):
    """A smoothed run of a ship that is linear."""
    h, rng = 0.05, np.random.default_rng(seed)
    time = np.arange(0.0, 48.0, h)
    omega, phase = rng.uniform(0.2, 1.5, (3, 4)), rng.uniform(0.0, 6.3, (3, 4))
    given = 0.4 * np.sin(omega * time[:, None, None] + phase).sum(axis=2)
    law, nu, eta = Continuous(linear, h), np.zeros((1, 3)), np.zeros((1, 3))
    poses = []
    for c in given:
        poses.append(eta[0])
        after = law.step(nu[None], c[None, None])
        nu, eta = after, moved(eta, 0.5 * (nu + after), h)
    pose = np.array(poses) + rng.normal(0.0, 1e-4, (time.size, 3))
    pose[:, 2] = np.angle(np.exp(1j * pose[:, 2]))
    run = Run(f"toy{seed}", time, pose, given, commands=given, signals=THREE)
    return diagnosis.smooth(diagnosis.clean(run))


@cache
def windows_of(seed):
    return diagnosis.Windows([toy(seed)], LENGTH)


def steady_error():
    return law_errors(Continuous(lambda nu, given: 0.0 * nu, 0.1), windows_of(3))


def test_nominal_model_misses_by_what_the_project_says():
    run, _ = sail(32.0, h=0.05)
    run = replace(run, commands=commanded_shares(run, Model()), signals=THREE)
    smoothed = diagnosis.smooth(diagnosis.clean(run))
    wrong = Model(vessel={"X_u": -2.0, "N_r": -0.5})
    windows = diagnosis.Windows([smoothed], LENGTH)
    expected = windows.errors(wrong).over_all()
    law = Continuous(Nominal(wrong, run.commands).acceleration, 0.05)
    assert law_errors(law, windows) == pytest.approx(expected, rel=0.01)


def test_law_that_is_true_predicts_and_one_that_is_not_does_not():
    assert law_errors(Continuous(linear, 0.05), windows_of(3)) < (0.01, 0.02)
    assert min(steady_error()) > 0.05


def test_diverging_law_is_worse_than_any():
    law = Continuous(lambda nu, given: 1e9 * nu, 0.1)
    position, heading = law_errors(law, windows_of(3))
    assert position > 1e3
    assert heading > 0.5


def test_table_has_the_motion_of_the_run():
    t = table(toy(1), 0.2)
    (part,) = t.parts
    assert t.nu_dot[part] == pytest.approx(linear(t.nu, t.given)[part], abs=0.05)


@pytest.mark.parametrize(
    ("name", "package", "setting"),
    [
        ("narx", "sysidentpy", {"inputs": "commands", "h": 0.2, "lags": 2, "degree": 1}),
        (
            "sindy",
            "pysindy",
            {
                "inputs": "commands",
                "delay": 0.0,
                "library": "linear",
                "threshold": 0.0,
                "derivative": "own",
            },
        ),
        (
            "kalman_regression",
            "numpy",
            {"inputs": "commands", "delay": 0.0, "terms": "linear", "process": 0.1},
        ),
        (
            "ridge",
            "numpy",
            {"inputs": "commands", "delay": 0.0, "terms": "linear", "weight": 1.0},
        ),
        ("neural", "sklearn", {"inputs": "commands", "delay": 0.0, "hidden": (16,), "alpha": 1e-4}),
    ],
)
@pytest.mark.filterwarnings("ignore")
def test_method_predicts_a_linear_ship(name, package, setting):
    pytest.importorskip(package, reason=f"not in the extra dev: {package}")
    law = import_module(f"benchmarks.ships.entries.{name}").law([toy(1), toy(2)], Ignorant(), **setting)
    errors = law_errors(law, windows_of(3))
    assert np.divide(errors, steady_error()).max() < (0.6 if name == "neural" else 0.1)


def pysindy():
    return pytest.importorskip("pysindy", reason="not in the extra dev: pysindy")


def theirs(library):
    """The package's own library of functions."""
    degree, drag = {"linear": (1, False), "drag": (2, True), "cubic": (3, False)}[library]
    polynomials = pysindy().PolynomialLibrary(degree=degree)
    if not drag:
        return polynomials
    squares = pysindy().CustomLibrary([lambda x: np.abs(x) * x], [lambda x: f"|{x}|{x}"])
    return pysindy().ConcatLibrary([polynomials, squares])


@pytest.mark.parametrize("library", ["linear", "drag", "cubic"])
def test_columns_are_those_of_the_library(library):
    sindy = pytest.importorskip("benchmarks.ships.entries.sindy")
    x = np.random.default_rng(1).normal(size=(20, 5))
    assert sindy.columns(library, x) == pytest.approx(np.asarray(theirs(library).fit(x).transform(x)))


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("terms", [1, 3, 7])
def test_forward_regression_that_runs_once_finds_what_the_package_finds(terms):
    selection = pytest.importorskip(
        "sysidentpy.model_structure_selection", reason="not in the extra dev: sysidentpy"
    )
    narx = import_module("benchmarks.ships.entries.narx")
    draw = np.random.default_rng(4)
    psi = draw.normal(size=(300, 9))
    y = psi[:, [2, 5, 7]] @ np.array([[1.0], [0.3], [-2.0]]) + 0.1 * draw.normal(size=(300, 1))
    once, usual = narx.OfParts(), selection.FROLS()
    once.max_lag = usual.max_lag = 1
    once.broken = np.zeros(301, dtype=bool)
    once.run_mss_algorithm(psi, np.vstack([y[:1], y]), 9)
    _, found, chosen, _ = once.run_mss_algorithm(psi, np.vstack([y[:1], y]), terms)
    _, expected, columns = usual.run_mss_algorithm(psi, np.vstack([y[:1], y]), terms)
    assert found.tolist() == expected.tolist()
    assert np.array_equal(chosen, columns)


@pytest.mark.parametrize("derivative", ["own", "smoothed differences"])
@pytest.mark.parametrize("threshold", [0.0, 0.02])
def test_sparse_law_is_that_of_the_package(threshold, derivative):
    sindy = pytest.importorskip("benchmarks.ships.entries.sindy")
    runs = [toy(1), toy(2)]
    law = sindy.law(runs, Ignorant(), "commands", 0.0, "drag", threshold, derivative)
    parts = [(t, p) for t in (table(r, sindy.STEP) for r in runs) for p in t.parts]
    model = pysindy().SINDy(
        optimizer=pysindy().STLSQ(threshold=threshold),
        feature_library=theirs("drag"),
        differentiation_method=pysindy().SmoothedFiniteDifference(),
    )
    model.fit(
        [t.nu[p] for t, p in parts],
        t=sindy.STEP,
        x_dot=[t.nu_dot[p] for t, p in parts] if derivative == "own" else None,
        u=[t.given[p] for t, p in parts],
    )
    nu, given = parts[0][0].nu[parts[0][1]], parts[0][0].given[parts[0][1]]
    assert law.acceleration(nu, given) == pytest.approx(model.predict(nu, u=given), rel=1e-6, abs=1e-9)


def training(*seeds):
    runs = [diagnosis.predictors.weak_windows(toy(k)) for k in seeds]
    return Training(runs, Model(), LENGTH)


def test_runs_that_are_left_out_reach_no_fit_and_a_delay_is_searched_beyond_its_grid():
    seen = []

    def fit(runs, nominal, slower, delay):
        seen.append({r.track.run.name for r in runs})
        return Continuous(lambda nu, given: slower * linear(nu, given), 0.1, delay - 0.4)

    found = searched("spy", fit, {"slower": (0.0, 1.0, 0.5), "delay": (0.0, 0.2)})(training(1, 2))
    assert found.law.delay == pytest.approx(0.0), "0.4 s, beyond the grid"
    assert seen[-1] == {"toy1", "toy2"}
    assert {frozenset(names) for names in seen[:-1]} == {frozenset({"toy1"}), frozenset({"toy2"})}


def test_uncertainty_counts():
    """A method that states twice its error is as accurate, and less likely; one that states half too."""
    predictor = OfLaw(Continuous(lambda nu, given: 0.0 * nu, 0.1))
    usual = spread(predictor, [windows_of(3)])
    right, wide, narrow = (score(predictor, windows_of(3), k * usual) for k in (1.0, 3.0, 0.3))
    assert right[:2] == wide[:2] == narrow[:2] == pytest.approx(steady_error())
    assert right.likelihood < min(wide.likelihood, narrow.likelihood)
    assert narrow.inside < right.inside < wide.inside


def test_bands_of_a_model_are_its_uncertainty():
    class Sure:
        at_samples = np.broadcast_to(1e-6 * np.eye(3), (*windows_of(3).measured.shape, 3))

    run, _ = sail(32.0, h=0.05)
    windows = diagnosis.Windows([diagnosis.smooth(diagnosis.clean(run))], LENGTH)
    Sure.at_samples = np.broadcast_to(1e-6 * np.eye(3), (len(windows.measured), 3, 3))
    wrong = OfModel(Model(vessel={"X_u": -2.0}), lambda smoothed, windows: Sure)
    assert score(wrong, windows, np.ones((8, 3))).inside < 0.5
    assert score(replace(wrong, bands=None), windows, np.ones((8, 3))).inside == 1.0


def test_outsider_joins_by_an_entry_point(monkeypatch):
    class Point:
        name = "mine"

        def load(self):
            return import_module("benchmarks.ships.entries.steady")

    def installed(group, name=None):
        return [Point()] if group == "cybership.methods" and name in (None, "mine") else []

    monkeypatch.setattr(ships, "entry_points", installed)
    predictor = ships.entry("mine")(training(1, 2))
    assert law_errors(predictor.law, windows_of(3)) == pytest.approx(steady_error(), rel=0.01)
    with pytest.raises(InputError, match="no entry 'mind'; did you mean 'mine'"):
        ships.entry("mind")


def test_the_page_begins_with_what_others_win(tmp_path):
    folder = tmp_path / "kvlcc2"
    folder.mkdir()

    def answer(name, position, heading):
        scores = [[position, heading, -1.0, 0.9]]
        found = {run: {"scores": scores, "seconds": 1.0} for run in ("one", "two")}
        (folder / f"{name}.json").write_text(json.dumps(found))

    answer("nominal", 0.3, 0.02)
    answer("calibrated", 0.1, 0.03)
    answer("learned", 0.2, 0.04)
    assert [*ships.lost(ships.means(folder, 0))] == [("heading", "calibrated", "nominal")]
    answer("ridge", 0.05, 0.01)
    page = ships.write(tmp_path).read_text()
    stated = "| kvlcc2, 20 s | position | calibrated | ridge |"
    assert page.index(stated) < page.index("Errors in windows")
    assert "| kvlcc2, 20 s | heading | calibrated | nominal, ridge |" in page
    for name in ("nominal", "ridge"):
        (folder / f"{name}.json").unlink()
    assert "smaller error" not in ships.write(tmp_path).read_text()


def test_what_is_not_run_stays_in_the_table(tmp_path):
    def answer(folder, position):
        (tmp_path / folder / "kvlcc2").mkdir(parents=True)
        found = {"one": {"scores": [[position, 0.02, -1.0, 0.9]], "seconds": 1.0}}
        (tmp_path / folder / "kvlcc2" / "ridge.json").write_text(json.dumps(found))
        return tmp_path / folder

    earlier = ships.stored_means(ships.write(answer("first", 0.3)).with_name("results.json"))
    others = {
        "otter, 10 s": earlier["kvlcc2, 20 s"],
        "kvlcc2, 20 s": {"steady": earlier["kvlcc2, 20 s"]["ridge"]},
    }
    now = ships.of_all(answer("second", 0.4), earlier | others)
    assert [*now] == ["kvlcc2, 20 s", "otter, 10 s"]
    assert [*now["kvlcc2, 20 s"]] == ["steady", "ridge"]
    assert (now["kvlcc2, 20 s"]["ridge"].position, now["otter, 10 s"]["ridge"].position) == (
        pytest.approx(0.4),
        pytest.approx(0.3),
    )
    assert "## otter, 10 s" in ships.write(tmp_path / "second", others).read_text()


def test_what_is_not_installed_is_reported_in_one_line(monkeypatch, capsys):
    def missing(name, package):
        raise ModuleNotFoundError(name)

    monkeypatch.setattr(ships, "import_module", missing)
    assert ships.entry("narx") is None
    (line,) = capsys.readouterr().err.splitlines()
    assert line == "'narx' is left out: it needs sysidentpy"


def simulator(monkeypatch, classes):
    """A simulator of this name in which only the ship is another one: it keeps what it is told."""
    module = SimpleNamespace(**classes)
    monkeypatch.setitem(sys.modules, "python_vehicle_simulator", SimpleNamespace(vehicles=module))
    monkeypatch.setitem(sys.modules, "python_vehicle_simulator.vehicles", module)


def test_runs_of_a_simulator_are_its_motion_by_orders_of_this_project(monkeypatch):
    class Turning:
        """Ahead with a hundredth of the mean shaft speed, turning with a hundredth of the difference."""

        def __init__(self, V_current, beta_current):
            assert (V_current, beta_current) == simulated_otter.CURRENT
            self.beta_c, self.T_n = beta_current, simulated_otter.LAG

        def dynamics(self, eta, nu, n, order, h):
            return np.array(
                [order.sum() / 200.0, 0.0, 0.0, 0.0, 0.0, (order[0] - order[1]) / 100.0]
            ), order

    simulator(monkeypatch, {"otter": Turning})
    logs = dict(simulated_otter.simulated())
    assert {"zigzag_6", "turn_port", "stop", "random_3"} <= set(logs)
    for name, log in logs.items():
        step = np.diff(log["time"])
        assert step == pytest.approx(np.full(step.size, 0.1))
        given = 2.0 * np.pi * log[["port.n", "starboard.n"]].to_numpy() / 100.0
        turned = 0.1 * (given[:, 0] - given[:, 1])
        off = log["psi"].to_numpy()[1:] - np.cumsum(turned)[:-1]
        # An order may change within a sample, in a zig-zag.
        assert np.abs(off).max() < 0.2, name
        if "zigzag" not in name:
            assert np.std(off) == pytest.approx(simulated_otter.NOISE[1], rel=0.1)
        way = 0.1 * given.mean(axis=1) * np.exp(1j * log["psi"].to_numpy())
        gone = (log["x"] + 1j * log["y"]).to_numpy()[1:]
        assert np.abs(gone - np.cumsum(way)[:-1]).max() < 0.02 * np.abs(way).sum(), name
    sides = np.sign(np.diff(logs["zigzag_6"]["psi"].rolling(20).mean().dropna()))
    assert np.abs(logs["zigzag_6"]["psi"]).max() < 0.6
    assert np.sum(np.diff(sides[sides != 0.0]) != 0.0) > 4


@pytest.mark.parametrize("other", [{"beta_c": np.radians(simulated_otter.CURRENT[1])}, {"T_n": 0.1}])
def test_another_version_of_the_simulator_is_refused(monkeypatch, other):
    def otter(V_current, beta_current):
        return SimpleNamespace(**{"beta_c": beta_current, "T_n": simulated_otter.LAG, **other})

    simulator(monkeypatch, {"otter": otter})
    with pytest.raises(InputError, match=r"another version; pip install git\+https"):
        next(iter(simulated_otter.simulated()))


def test_a_data_set_without_its_simulator_is_left_out_in_one_line(monkeypatch, capsys, tmp_path):
    monkeypatch.setitem(sys.modules, "python_vehicle_simulator", None)
    assert ships.main([str(tmp_path), "--datasets", "otter", "--out", str(tmp_path / "out")]) == 0
    stated = capsys.readouterr()
    (line,) = [x for x in (stated.out + stated.err).splitlines() if "'otter' is left out" in x]
    assert "'otter'" in line
    assert "pip install git+https" in line
    assert not (tmp_path / "out" / "otter").exists()


def test_other_files_than_those_of_the_split_are_refused(tmp_path):
    data = DATASETS["kvlcc2"]
    with pytest.raises(InputError, match="get them: HSVA"):
        data.load(tmp_path)
    (tmp_path / data.folder).mkdir()
    (tmp_path / data.folder / "z_1.csv").write_text("t\n")
    with pytest.raises(InputError, match="not those of the split"):
        data.load(tmp_path)


@needs_data
def test_hashes_are_those_of_the_public_files():
    for data in DATASETS.values():
        files = [f for pattern in data.files for f in (DATA / data.folder).glob(pattern)]
        assert not files or digest_of(files) == data.digest, data.folder


def run_named(name):
    return SimpleNamespace(run=SimpleNamespace(name=name))


def test_runs_of_one_log_are_never_in_training_and_test():
    kinds = [run_named(n) for n in ("a_11_00_00_1", "a_11_00_00_2", "b_12_00_00", "c_13_00_00")]
    folds = replace(DATASETS["esso_osaka"], folds=2).split(kinds)
    a1, a2, b, c = kinds
    assert folds == [([b], [a1, a2, c]), ([a1, a2, c], [b])]
    listed = replace(DATASETS["esso_osaka"], train=("a_11_00_00_1", "b_12_00_00")).split(kinds)
    assert listed == [([a1, b], [c])]


@pytest.mark.parametrize("further", [[], ["--keep", "absent.json"], ["--compare", "absent.json"]])
def test_bad_input_is_one_line_and_nothing_is_written(further, capsys, tmp_path):
    out = tmp_path / "out"
    assert ships.main([str(tmp_path), "--datasets", "kvlcc2", "--out", str(out), *further]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith("error: no results of" if further else "error: no z_")
    assert not out.exists()


def test_errors_of_another_environment_are_compared(tmp_path):
    def answered(folder, position):
        (folder / "cse1").mkdir(parents=True)
        answer = {"a": {"scores": [[position, 0.2, -1.0, 0.9]], "seconds": 1.0}}
        (folder / "cse1" / "ridge.json").write_text(json.dumps(answer))
        return ships.stored_means(ships.write(folder).with_name("results.json"))

    first, near, far = (answered(tmp_path / n, x) for n, x in (("1", 0.5), ("2", 0.504), ("3", 0.51)))
    assert ships.differing(first, near) == []
    assert ships.differing(first, far) == ["cse1, 8 s, ridge: position 0.51 in place of 0.5"]
    with pytest.raises(InputError, match="in common"):
        ships.differing(first, {})
    with pytest.raises(InputError, match="no results of this table"):
        ships.stored_means(tmp_path / "1" / "cse1" / "ridge.json")


def test_table_compares_with_the_nominal_model(tmp_path):
    folder = tmp_path / "cse1"
    folder.mkdir()
    for name, errors in {"nominal": (0.4, 0.2), "learn": (0.1, 0.4), "ridge": (0.3, 0.3)}.items():
        found = {"scores": [Score(*errors, -1.0, 0.9)], "seconds": 2.0}
        (folder / f"{name}.json").write_text(json.dumps({"a": found, "b": found}))
    found = {name: cells for name, *cells in ships.rows(ships.means(folder, 0))}
    assert found["learn"] == ["2", "0.1", "22.9", "4.00x", "0.50x", "-1", "90", "2"]
    assert "| ridge | 2 | 0.3 |" in ships.write(tmp_path).read_text()
