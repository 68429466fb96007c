"""Measurement faults on a table of values."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from support.project import ROOT

from cosim.errors import InputError
from cosim.scenario import faults, load_scenario

H = 0.01


def play(fault, rows, h=H, seed=0):
    """What arrives of a sequence of rows, the fault acting on all columns."""
    width = len(rows[0])
    effect = fault.bind(list(range(width)), h, np.random.default_rng(seed))
    arrived = []
    for k, row in enumerate(rows):
        values = list(row)
        effect(values, round(k * h, 12))
        arrived.append(tuple(values))
    return arrived


def make(kind, width=1, **options):
    return faults.KINDS[kind](kind=kind, signals=[f"a.x{k}" for k in range(width)], **options)


RAMP = [(float(k), -float(k)) for k in range(500)]


def test_freeze_holds_the_last_value_on_the_whole_group():
    arrived = play(make("freeze", 2, at=[1.0], duration=0.5), RAMP)
    assert arrived[:100] == RAMP[:100]
    assert arrived[100:150] == [RAMP[99]] * 50
    assert arrived[150:] == RAMP[150:]


def test_freeze_at_the_start_holds_the_first_value():
    assert play(make("freeze", 2, at=[0.0], duration=0.1), RAMP)[:11] == [RAMP[0]] * 10 + [RAMP[10]]


def test_dropout_is_nan_or_zero():
    nan = play(make("dropout", 2, at=[1.0, 2.0], duration=0.1), RAMP)
    assert [k for k, row in enumerate(nan) if all(map(math.isnan, row))] == [
        *range(100, 110),
        *range(200, 210),
    ]
    zero = play(make("dropout", 2, at=[1.0], duration=0.1, value="zero"), RAMP)
    assert zero[105] == (0.0, 0.0)


def test_spikes_last_a_sample_and_have_the_size_asked_for():
    arrived = np.array(play(make("spikes", 2, rate=2.0, size=[0.5, 0.1]), RAMP))
    off = np.abs(arrived - RAMP)
    hit = off[:, 0] > 0
    assert 3 <= hit.sum() <= 25
    assert off[hit] == pytest.approx(np.tile([0.5, 0.1], (hit.sum(), 1)))
    assert (off[~hit] == 0).all()


def test_noise_has_its_standard_deviation_and_is_white():
    arrived = np.array(play(make("noise", 2, std=[0.3, 0.0]), [(0.0, 0.0)] * 20000))
    assert arrived[:, 0].std() == pytest.approx(0.3, rel=0.03)
    assert arrived[:, 0].mean() == pytest.approx(0.0, abs=0.01)
    assert abs(np.corrcoef(arrived[1:, 0], arrived[:-1, 0])[0, 1]) < 0.03
    assert (arrived[:, 1] == 0.0).all()


@pytest.mark.filterwarnings("error")
def test_noise_beyond_all_numbers_warns_of_nothing():
    arrived = np.array(play(make("noise", std=1e308), [(0.0,)] * 100))
    assert np.isinf(arrived).any()


def test_bias_adds():
    assert play(make("bias", 2, value=[1.0, -2.0]), [(0.5, 0.5)]) == [(1.5, -1.5)]


def test_delay_is_a_whole_number_of_samples():
    arrived = play(make("delay", 2, time=0.052), RAMP)
    assert arrived[:5] == [RAMP[0]] * 5
    assert arrived[5:] == RAMP[:-5]
    assert play(make("delay", 2, time=0.0), RAMP) == RAMP


@given(st.floats(-1000.0, 1000.0))
def test_wrapped_angle_is_the_same_direction(angle):
    ((wrapped,),) = play(make("wrap"), [(angle,)])
    assert -math.pi < wrapped <= math.pi
    assert math.cos(wrapped - angle) == pytest.approx(1.0)


def test_wrap_keeps_pi_and_turns_minus_pi():
    assert play(make("wrap"), [(math.pi,), (-math.pi,)]) == [(math.pi,), (math.pi,)]


def test_random_freezes_come_at_their_rate_and_last_as_long_as_asked():
    rows = [(float(k), 0.0) for k in range(400000)]
    arrived = np.array(play(make("freeze", 2, rate=0.05, duration=[0.1, 1.0]), rows))[:, 0]
    frozen = np.concatenate([[False], arrived[1:] == arrived[:-1]])
    starts = np.flatnonzero(frozen[1:] & ~frozen[:-1]) + 1
    ends = np.flatnonzero(~frozen[1:] & frozen[:-1]) + 1
    lengths = (ends[: len(starts)] - starts[: len(ends)]) * H
    # 4000 s at one every 20 s and half a second of freeze: about 195.
    assert len(starts) == pytest.approx(195, abs=45)
    assert lengths.min() >= 0.09
    assert lengths.max() <= 1.01
    assert lengths.mean() == pytest.approx(0.55, abs=0.1)


def test_same_seed_same_faults():
    freeze = make("freeze", 2, rate=1.0, duration=[0.1, 0.3])
    assert play(freeze, RAMP, seed=3) == play(freeze, RAMP, seed=3)
    assert play(freeze, RAMP, seed=3) != play(freeze, RAMP, seed=4)


def test_stages_follow_the_measurement_chain():
    stages = [
        faults.KINDS[k].stage for k in ("bias", "noise", "spikes", "wrap", "delay", "freeze", "dropout")
    ]
    assert stages == sorted(stages)


@pytest.mark.parametrize(
    ("fault", "message"),
    [
        ({"kind": "freez", "signals": ["observer.x_m"]}, "did you mean 'freeze'"),
        ({"signals": ["observer.x_m"]}, "needs a 'kind'"),
        ({"kind": "freeze", "signals": ["observer.x_m"]}, "either 'at' (times) or 'rate'"),
        ({"kind": "freeze", "signals": ["observer.x_m"], "at": [1.0], "rate": 1.0}, "either 'at'"),
        ({"kind": "freeze", "signals": [], "rate": 1.0}, "faults[0].signals"),
        ({"kind": "freeze", "signals": ["observer.x_m"], "rate": -1.0}, "faults[0].rate"),
        ({"kind": "freeze", "signals": ["observer.x_m"], "rate": 1.0, "duration": [2, 1]}, "shorter"),
        ({"kind": "freeze", "signals": ["observer.x_m"], "rate": 1.0, "durations": 1}, "did you mean 'duration'"),
        ({"kind": "noise", "signals": ["observer.x_m"], "std": [0.1, 0.2]}, "one for each of the 1"),
        ({"kind": "noise", "signals": ["observer.x_m"], "std": -0.1}, "faults[0].std"),
        ({"kind": "dropout", "signals": ["observer.x_m"], "at": [1.0], "value": "none"}, "'nan' or 'zero'"),
    ],
)  # fmt: skip
def test_wrong_fault_is_refused_by_name(ellipse, fault, message):
    ellipse["faults"] = [fault]
    with pytest.raises(InputError) as error:
        load_scenario(ellipse)
    assert message in str(error.value)
    assert "faults[0]" in str(error.value)


def test_example_of_the_contributing_guide_registers_itself():
    section = (ROOT / "CONTRIBUTING.md").read_text().split("## A new measurement fault")[1]
    text = section.split("```python\n")[1].split("```")[0]
    exec(text, vars(faults) | {"__name__": "mine"})
    assert play(make("scale", factor=3.0), [(2.0,)]) == [(6.0,)]
    del faults.KINDS["scale"]
