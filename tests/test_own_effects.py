"""A user's effects and methods, those of docs/own_effects.md: each in one file, and found."""

import re

import fmpy
import numpy as np
import pytest
from support.measured import sail, smoothed
from support.own_effects import DECLARED, LEAST_SQUARES, LINEAR, SECOND_ORDER

from cosim import InputError
from diagnosis import Model, diagnose
from diagnosis.predictors import omega, weak_windows
from diagnosis.predictors.thrust import Response, thrust
from diagnosis.predictors.uncertainty import omega_std
from diagnosis.report.finding_text import sentence
from diagnosis.search import Method, method
from diagnosis.search.candidates import candidates, model_error
from fmus.build import build
from fmus.declare import DeclarationError
from fmus.effects import STANDARD
from fmus.effects.effect_set import is_linear
from fmus.effects.text import Found
from fmus.ship import ship

BELL = '''
from typing import Annotated
from fmus.declare import POSITIVE
from fmus.effects import effect
from support.cse1 import BOW
from fmus.effects.devices import changed
from fmus.ops import exp

@effect("bow_bell", kind="actuator", axis="YN", formula="f_bow exp(-(k u)^2)", linear=False, needs=("bow",))
def bow_bell(f, now, bow_bell: Annotated[float, "s/m", "bow force lost at speed", POSITIVE] = 0.0):
    """The bow thruster fades with the speed."""
    return changed(f, [BOW], lambda x: x * exp(-bow_bell * bow_bell * now.u * now.u))
'''

MOMENT = '''
from typing import Annotated
from fmus.effects import effect

@effect("N_mine", kind="force", axis="N", formula="{formula}", symbol="k")
def N_mine(ship, N_mine: Annotated[float, "1", "a moment"] = 0.0):
    """A moment that I suspect."""
    return 0.0, 0.0, N_mine * {formula}
'''


@pytest.fixture
def craft(tmp_path):
    """A ship with the effects of a file of this text."""

    def made(text, name="mine.py"):
        file = tmp_path / name
        file.parent.mkdir(exist_ok=True)
        file.write_text(text)
        return ship(STANDARD.plus_file(file))

    return made


def windows(seconds=96.0, **hidden):
    run, _ = sail(seconds, 0.05, **hidden)
    return weak_windows(smoothed(run))


def learn(w, craft=None):
    return method().fit([w], Model(ship=craft or ship()), 0.0, lambda _: None, 0)


@pytest.mark.slow
def test_nonlinear_effect_is_found_with_its_exponent(craft):
    mine = craft(DECLARED)
    w = windows(ship={"drag_k": 6.0, "drag_exponent": 1.5}, craft=mine)
    first = learn(w, mine).effects[0]
    assert first.id == "power_drag"
    assert first.values["drag_k"] == pytest.approx(6.0, rel=0.1)
    assert 1.0 + first.values["drag_exponent"] == pytest.approx(1.5, rel=0.1)
    for name, truth in (("drag_k", 6.0), ("drag_exponent", 0.5)):
        low, high = first.ci95[name]
        assert low < truth < high


def test_a_shape_parameter_is_tried_by_value_and_stays_in_its_range(craft):
    mine = craft(DECLARED)
    w = windows(32.0)
    model = Model({"drag_exponent": 2.0}, ship=mine)
    base = model_error([w], model)
    shapes = next(c.shapes for c in candidates([w], model, base) if c.effect.id == "power_drag")
    assert [s.given["drag_exponent"] for s in shapes] == [-1.0, 0.0, 1.0], "additions to the model's 2"


CIRCLE = '''
from typing import Annotated

from fmus.declare import Range
from fmus.effects import effect
from fmus.ops import where


@effect("circle", "force", "X", formula="X = k within a circle", linear=False)
def circle(
    ship,
    circle_force: Annotated[float, "N", "force"] = 0.0,
    circle_radius: Annotated[float, "m", "radius", Range(0.1, 5.0)] = 0.5,
):
    """A force within a circle."""
    north, east = ship.x - 3.5, ship.y - 8.5
    inside = north * north + east * east < circle_radius * circle_radius
    return where(inside, circle_force, 0.0), 0.0, 0.0
'''


@pytest.mark.slow
def test_interval_of_a_radius_holds_the_truth_and_is_no_curvature(craft):
    """The slope by a radius is made of the few samples between two circles."""
    mine = craft(CIRCLE)
    w = windows(160.0, ship={"circle_force": -0.3, "circle_radius": 1.9}, craft=mine)
    first = learn(w, mine).effects[0]
    assert first.id == "circle"
    low, high = first.ci95["circle_radius"]
    assert low < 1.4 < high, "additions to the 0.5 m that it starts from"
    assert high - low < 0.1


@pytest.mark.slow
def test_nonlinear_effect_that_saturates_is_found_without_values_to_try(craft):
    mine = craft(BELL)
    w = windows(thrusters={"bow_bell": 6.0}, craft=mine)
    first = learn(w, mine).effects[0]
    assert first.id == "bow_bell"
    assert first.values["bow_bell"] == pytest.approx(6.0, rel=0.1)


@pytest.mark.parametrize(
    ("formula", "linear"),
    [("ship.u * ship.v", True), ("abs(N_mine)", False), ("(1.0 + N_mine * ship.u)", False)],
)
def test_an_effect_that_is_linear_in_name_only_is_refused(tmp_path, formula, linear):
    file = tmp_path / "mine.py"
    file.write_text(MOMENT.format(formula=formula))
    if linear:
        assert is_linear(STANDARD.plus_file(file)["N_mine"])
    else:
        with pytest.raises(DeclarationError, match="linear=False"):
            STANDARD.plus_file(file)


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ("N_mine * ship.u", "object is not iterable; a force gets ship.x, ship.y"),
        ("(0.0, N_mine * ship.u)", "returns 2 numbers; a force gets ship.x"),
        ("(0.0, 0.0, N_mine * ship.north)", "no attribute 'north'; a force gets ship.x"),
        ("(0.0, N_mine * ship.v, N_mine)", "returns a force on Y, and is declared for N"),
        (
            "(0.0, 0.0, N_mine * ship.u + 3.0)",
            "returns a force with N_mine = 0, where there is no effect",
        ),
    ],
)
def test_a_function_that_gives_no_force_is_refused_with_one_line(tmp_path, given, message):
    file = tmp_path / "mine.py"
    file.write_text(re.sub(r"return .*", f"return {given}", MOMENT.format(formula="1.0")))
    with pytest.raises(DeclarationError, match=re.escape(message)):
        STANDARD.plus_file(file)


@pytest.mark.filterwarnings("ignore:invalid value")
def test_an_effect_without_a_value_in_a_part_of_the_data_is_no_candidate(craft):
    """Its loss would be no number, and with it the confidence of every effect."""
    mine = craft(MOMENT.format(formula="(ship.u - 0.05) ** 0.5"))
    w = windows()
    model = Model(ship=mine)
    found = {c.effect.id for c in candidates([w], model, model_error([w], model))}
    assert "N_mine" not in found
    assert "X_u" in found


def test_every_effect_of_the_project_that_is_called_linear_is():
    assert all(is_linear(e) for e in STANDARD.values() if e.linear and e.function)


@pytest.mark.slow
def test_effect_with_memory_is_found(craft):
    mine = craft(SECOND_ORDER)
    w = windows(thrusters={"second_lag": 0.4}, craft=mine)
    first = learn(w, mine).effects[0]
    assert first.id == "second_lag"
    assert first.values["second_lag"] == pytest.approx(0.4, rel=0.1)


def test_effect_with_memory_acts_in_the_fmu_as_on_series(craft, tmp_path):
    mine = craft(SECOND_ORDER)
    (fmu,) = build(["thrusters"], tmp_path / "fmu", effects=mine.effects)
    run, nu = sail(20.0, noise=0.0)
    names = ["tau_X", "tau_Y", "tau_N", "u", "v", "r"]
    signals = np.rec.fromarrays([run.time, *run.tau_cmd.T, *nu.T], names=["time", *names])
    result = fmpy.simulate_fmu(
        str(fmu),
        start_values={"second_lag": 0.5},
        input=signals,
        output=[f"tau_act_{a}" for a in "XYN"],
        stop_time=float(run.time[-1]),
        step_size=0.02,
        output_interval=0.02,
    )
    by_steps = np.column_stack([result[f"tau_act_{a}"] for a in "XYN"])[1:]
    slow = Model(thrusters={"second_lag": 0.5}, ship=mine)
    by_series = thrust(run, slow, Response(run, slow).between_samples, nu)
    size = min(len(by_steps), len(by_series))
    assert np.abs(by_steps).max() > 0.1
    assert by_steps[:size] == pytest.approx(by_series[:size], abs=1e-6)


def test_ships_with_and_without_a_users_effects_live_in_one_process(craft):
    one = craft(LINEAR, "a/mine.py")
    other = craft(MOMENT.format(formula="ship.u * ship.r").replace("N_mine", "N_uuv"), "b/mine.py")
    w = windows(32.0).thinned
    nominal, value = omega(w, Model()), {"N_uuv": 400.0}
    u, v, r = np.where(w.known[:, None], w.smoothed.nu, 0.0).T
    for craft, product in ((one, u * u * v), (other, u * r), (one, u * u * v)):
        gives = nominal - omega(w, Model(value, ship=craft))
        assert gives[:, 2] == pytest.approx(w.smooth @ (400.0 * product), abs=1e-9)
    stds = [omega_std(w, Model(value, ship=craft)) for craft in (one, other)]
    w.memory.clear()
    assert stds[1] == pytest.approx(omega_std(w, Model(value, ship=other)), rel=1e-12)
    assert stds[0] != pytest.approx(stds[1], rel=1e-3)
    said = sentence(Found(one.effects["N_uuv"], value))
    assert said.startswith("A drift at speed turns the ship: ")
    assert "N_uuv" not in ship().effects


@pytest.mark.slow
def test_a_method_of_a_user_is_a_file_or_an_object(tmp_path):
    file = tmp_path / "mine.py"
    file.write_text(LEAST_SQUARES)
    mine = method(str(file))
    assert isinstance(mine, Method)
    w = windows(64.0, ship={"delta_X_u": -3.0})
    result = diagnose([w], by=mine)
    assert [f.id for f in result.learned.effects] == ["X_u"]
    assert result.learned.effects[0].values["delta_X_u"] == pytest.approx(-3.0, rel=0.1)


@pytest.mark.parametrize(
    ("text", "stated"),
    [(None, "no such"), ("METHOD = 3", "METHOD"), ("x = 1", "METHOD"), ("1 / 0", "ZeroDivisionError")],
)
def test_a_wrong_file_of_a_method_is_told(tmp_path, text, stated):
    file = tmp_path / "mine.py"
    if text is not None:
        file.write_text(text)
    with pytest.raises(InputError, match=stated):
        method(str(file))


def test_a_ship_has_its_actuators_and_their_units():
    assert ship().devices == {"vsp", "bow", "vsp1", "vsp2"}
