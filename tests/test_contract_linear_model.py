"""A linear model of an FMU by answers that are given: states, slopes, files."""

import json
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.io import loadmat

from cosim import InputError, SimulationError
from diagnosis.fmu_parameters import linear_model
from diagnosis.fmu_parameters.linear_model import LinearModel, LinearState, linearised, states_of

# d/dt (p, v) = (v, -2 p - 0.5 v + 3 f), seen: p and 4 p + f.
A, B = np.array([[0.0, 1.0], [-2.0, -0.5]]), np.array([[0.0], [3.0]])
C, D = np.array([[1.0, 0.0], [4.0, 0.0]]), np.array([[0.0], [1.0]])
RATES = [LinearState("p", "der(p)", 0), LinearState("v", "der(v)", 0)]
SEEN = [LinearState("p", "p_seen", 1), LinearState("v", "p_seen", 2)]
AT = {"p": 0.3, "v": -0.2, "f": 1.5}
OUTPUTS = ["p_seen", "w"]


class Steps:
    """Answers of the system in place of short steps of an FMU."""

    def __init__(self, fmu, inputs, outputs, h, late):
        self.inputs, self.outputs, self.h, self.late = inputs, outputs, h, late
        self.fmu = fmu
        fmu.steps.append(h)

    def run(self, start, driven):
        assert [*driven] == self.inputs
        x, u = np.concatenate([start["p"], start["v"]]), driven["f"]
        rate = A @ x + B @ u + self.fmu.bend * np.array([0.0, x[0] ** 2])
        y = C @ x + D @ u
        values = {"der(p)": rate[0], "der(v)": rate[1], "p_seen": y[0], "w": y[1]}
        found = {n: np.array([[values[n]], [np.nan]]) for n in self.outputs}
        self.rate = rate
        return found

    def derivatives(self, x):
        longer = 0.0 if self.fmu.rough == 0.0 else self.fmu.rough * self.h
        return self.rate[0], self.rate[1] * (1.0 + longer)

    def close(self):
        self.fmu.closed += 1


class Unclosed(SimpleNamespace):
    def close(self):
        self.closed += 1


def variable(name, start=0.0, reference=0, unit=None):
    return SimpleNamespace(name=name, start=start, reference=reference, unit=unit)


def model(**more):
    names = ("p", "v", "der(p)", "der(v)", "p_seen", "w", "f")
    variables = {n: variable(n, 0.1 * k, k) for k, n in enumerate(names)}
    stated = SimpleNamespace(providesDirectionalDerivative=False)
    return SimpleNamespace(
        variables=variables, suggested_step=None, path=SimpleNamespace(name="m.fmu"),
        reals=lambda causality: [variables["f"]] if causality == "input" else [],
        description=SimpleNamespace(coSimulation=stated), **more,
    )  # fmt: skip


@pytest.fixture
def fmu(monkeypatch):
    """An FMU of the system; ``bend``: of a square in it, ``rough``: share of its rates by step."""
    made = Unclosed(model=model(), steps=[], closed=0, bend=0.0, rough=0.0)
    monkeypatch.setattr(linear_model, "confined", lambda model, execution: made)
    monkeypatch.setattr(linear_model, "ShortSteps", Steps)
    return made


@pytest.mark.parametrize(("states", "seconds"), [(RATES, [1e-3]), (SEEN, [1e-3, 2e-3])])
def test_matrices_are_the_slopes_of_rates_and_outputs(fmu, states, seconds):
    found = linearised(fmu.model, states, AT, OUTPUTS)
    for name, matrix in {"A": A, "B": B, "C": C, "D": D}.items():
        np.testing.assert_allclose(getattr(found, name), matrix, atol=1e-8)
    x, u = np.array([0.3, -0.2]), np.array([1.5])
    assert found.x_dot == pytest.approx(A @ x + B @ u)
    y = C @ x + D @ u
    assert found.at == pytest.approx({**AT, "p_seen": y[0], "w": y[1]})
    assert (found.states, found.inputs, found.outputs) == (["p", "v"], ["f"], OUTPUTS)
    assert fmu.steps == seconds, "longer ones only where rates are by steps"
    assert found.doubt == pytest.approx(0.0, abs=1e-9)
    assert fmu.closed == len(seconds) + 1


def test_what_is_not_given_has_its_start_value(fmu):
    found = linearised(fmu.model, RATES, {"v": 2.0}, OUTPUTS)
    assert {n: found.at[n] for n in ("p", "v", "f")} == pytest.approx({"p": 0.0, "v": 2.0, "f": 0.6})
    fmu.model.variables["f"].start = None
    assert linearised(fmu.model, RATES, {}, OUTPUTS).at["f"] == 0.0


def test_doubt_is_the_change_by_longer_steps(fmu):
    """Rates of v are off by 5 h of themselves: steps of 2 ms change them by 0.5 %."""
    fmu.rough = 5.0
    found = linearised(fmu.model, SEEN, AT, OUTPUTS)
    assert found.doubt == pytest.approx(0.005 / 1.005)
    fmu.model.suggested_step = 0.1
    fmu.steps.clear()
    linearised(fmu.model, SEEN, AT, OUTPUTS)
    assert fmu.steps == [0.1, 0.2]


def test_differences_are_central(fmu):
    """A square has no error by them, wherever it is."""
    fmu.bend = 1.0
    found = linearised(fmu.model, RATES, {**AT, "p": 50.0}, OUTPUTS)
    assert found.A[1] == pytest.approx([-2.0 + 2.0 * 50.0, -0.5], rel=1e-9)


def test_what_is_not_finite_is_refused(fmu):
    fmu.bend = np.nan
    with pytest.raises(InputError, match=r"m\.fmu' has no finite derivatives"):
        linearised(fmu.model, RATES, AT, OUTPUTS)


class Instance:
    """An FMU that gives its own slopes, other ones than by steps."""

    def __init__(self, fmu):
        self.fmu, self.values, self.calls, self.fails = fmu, {}, [], False

    def set_up(self, h):
        self.calls.append(("set up", h))

    def set_value(self, v, value):
        assert self.calls[-1] == ("set up", 1e-3)
        self.values[v.name] = value

    def enter_initialization(self):
        self.calls.append("enter")

    def exit_initialization(self):
        self.calls.append("exit")

    def directional_derivative(self, unknown, known):
        assert self.calls[1:] == ["enter", "exit"]
        if self.fails:
            raise SimulationError("no")
        rows = {"der(p)": 0, "der(v)": 1, "p_seen": 2, "w": 3, "p": 4}
        column = ["p", "v", "f"].index(known.name)
        J = np.vstack([np.hstack([A, B]), np.hstack([C, D]), np.zeros((1, 3))]) * 10.0
        return [J[rows[v.name], column] for v in unknown]

    def free(self):
        self.calls.append("free")


def test_slopes_are_those_of_the_fmu_where_it_has_them(fmu):
    instance = Instance(fmu)
    fmu.instance = lambda: instance
    fmu.model.description.coSimulation.providesDirectionalDerivative = True
    found = linearised(fmu.model, RATES, AT, OUTPUTS)
    np.testing.assert_allclose(found.A, 10.0 * A)
    np.testing.assert_allclose(found.D, 10.0 * D)
    assert instance.values == AT
    assert instance.calls[-1] == "free"
    assert found.doubt == 0.0
    # By differences of outputs a rate has no such slope; nor if the FMU refuses.
    np.testing.assert_allclose(linearised(fmu.model, SEEN, AT, OUTPUTS).A, A, atol=1e-8)
    instance.fails, instance.calls = True, []
    np.testing.assert_allclose(linearised(fmu.model, RATES, AT, OUTPUTS).A, A, atol=1e-8)
    assert instance.calls[-1] == "free"
    fmu.model.description.coSimulation = None
    np.testing.assert_allclose(linearised(fmu.model, RATES, AT, OUTPUTS).A, A, atol=1e-8)


def test_an_output_that_is_a_state_has_the_slope_one(fmu):
    """Some tools return zero."""
    instance = Instance(fmu)
    fmu.instance = lambda: instance
    fmu.model.variables["p_seen"].reference = fmu.model.variables["p"].reference
    J = linear_model._exact(fmu, RATES, {"p": 0.3, "v": -0.2}, {"f": 1.5}, OUTPUTS, 1e-3)
    assert J is None, "it has none"
    fmu.model.description.coSimulation.providesDirectionalDerivative = True
    J = linear_model._exact(fmu, RATES, {"p": 0.3, "v": -0.2}, {"f": 1.5}, OUTPUTS, 1e-3)
    np.testing.assert_allclose(J[2], [1.0, 0.0, 0.0])
    np.testing.assert_allclose(J[3], [40.0, 0.0, 10.0])


def unknown(rate, state):
    return SimpleNamespace(variable=SimpleNamespace(name=rate, derivative=SimpleNamespace(name=state)))


def test_states_are_those_that_the_fmu_lists():
    other = SimpleNamespace(variable=SimpleNamespace(name="power", derivative=None))
    none = SimpleNamespace(variable=None)
    made = model(can_be_set=lambda v: v.name != "v")
    made.description.derivatives = [none, other, unknown("der(p)", "p")]
    assert states_of(made, None) == [LinearState("p", "der(p)", 0)]
    made.description.derivatives.append(unknown("der(v)", "v"))
    with pytest.raises(InputError, match=r"state 'v' of 'm\.fmu' cannot be set"):
        states_of(made, None)


def test_states_of_a_map_have_the_rates_that_are_declared():
    start = {
        "x": SimpleNamespace(name="p"),
        "der(x)": SimpleNamespace(name="v"),
        "y": SimpleNamespace(name="q"),
    }
    outputs = {n: SimpleNamespace(name=f"{n}_seen") for n in "xy"}
    given = SimpleNamespace(start=start, outputs=outputs)
    made = model()
    made.description.modelVariables = []
    found = states_of(made, given)
    assert found == [
        LinearState("p", "x_seen", 1),
        LinearState("v", "x_seen", 2),
        LinearState("q", "y_seen", 1),
    ]
    rate = SimpleNamespace(name="der(q)", derivative=SimpleNamespace(name="q"))
    made.description.modelVariables = [rate, SimpleNamespace(name="q", derivative=None)]
    assert states_of(made, given)[2] == LinearState("q", "der(q)", 0)


def test_states_of_a_ship_are_its_motion_where_it_is_set_and_seen(monkeypatch):
    made = model()
    made.description.derivatives = []
    stated = {
        "start": {n: SimpleNamespace(name=f"{n}_0") for n in ("psi", "u", "x")},
        "outputs": {n: SimpleNamespace(name=f"{n}_out") for n in ("x", "u", "r")},
    }
    monkeypatch.setattr(linear_model, "propose", lambda *_: SimpleNamespace(stated=stated.__getitem__))
    assert states_of(made, None) == [LinearState("x_0", "x_out", 1), LinearState("u_0", "u_out", 1)]
    stated["outputs"] = {}
    with pytest.raises(InputError, match=r"no state of 'm\.fmu' can be set"):
        states_of(made, None)


def test_files_have_values_units_and_eigenvalues(tmp_path):
    units = {"p": "m", "v": "m/s", "f": "N", "p_seen": "m", "w": "1"}
    at = {"p": 0.3, "v": -0.2, "f": 1.5, "p_seen": 0.3, "w": 2.7}
    made = LinearModel(["p", "v"], ["f"], OUTPUTS, at, np.array([1.0, 2.0]), A, B, C, D, 0.0)
    assert made.write(tmp_path, units) == ["linear.json", "linear.mat"]
    stated = json.loads((tmp_path / "linear.json").read_text())
    assert stated["states"] == [
        {"name": "p", "unit": "m", "value": 0.3}, {"name": "v", "unit": "m/s", "value": -0.2},
    ]  # fmt: skip
    assert [x["name"] for x in stated["inputs"] + stated["outputs"]] == ["f", "p_seen", "w"]
    assert (stated["A"], stated["x_dot"]) == (A.tolist(), [1.0, 2.0])
    real, imaginary = np.transpose(stated["eigenvalues"])
    # s^2 + 0.5 s + 2
    assert sorted(real + 1j * imaginary, key=lambda s: s.imag) == pytest.approx(
        [-0.25 - 1j * np.sqrt(2.0 - 0.0625), -0.25 + 1j * np.sqrt(2.0 - 0.0625)]
    )
    cells = loadmat(tmp_path / "linear.mat", squeeze_me=True)
    np.testing.assert_array_equal(cells["C"], C)
    assert [*cells["states"], *cells["outputs_units"]] == ["p", "v", "m", "1"]
    none = LinearModel([], ["f"], ["w"], at, *(np.zeros((0, 0)) for _ in range(5)), 0.0)
    none.write(tmp_path, units)
    assert json.loads((tmp_path / "linear.json").read_text())["eigenvalues"] == []
