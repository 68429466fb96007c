"""Runs of which an analysis keeps what it needs: the log of a run without files is that of one with them."""

import signal
from contextlib import closing

import numpy as np
import pytest

import cosim
from cosim.dispatch import analyse_runs, measured_run
from cosim.dispatch.job import Job, RunRow
from cosim.results import MetricsError
from cosim.system.instance_pool import InstancePool


@pytest.fixture
def short(ellipse):
    """The ellipse of 1 s, with few signals and a row for every second step."""
    log = {"signals": ["vessel.*", "observer.x_m"], "every": 2}
    return {**ellipse, "stop": 1.0, "metrics": {}, "log": log}


def test_a_run_without_metrics_is_done_and_says_why(monkeypatch):
    made = measured_run.Measured()
    monkeypatch.setattr(measured_run, "run_in_memory", lambda pool, scenario: {"W": 1.0})
    assert made(None, None) == RunRow("done", "", 0.0, {"W": 1.0}, {})

    def none(pool, scenario):
        raise MetricsError("the log has no rows")

    monkeypatch.setattr(measured_run, "run_in_memory", none)
    assert made(None, None) == RunRow("done", "no metrics: the log has no rows", 0.0, {}, {})


def test_a_run_is_known_by_what_its_numbers_follow_from():
    """Files by what they hold, but for those that are said to be alike."""
    content = {"name": "a", "stop": 1.0, "fmus": {"ship": {"path": "one.fmu", "step": 0.1}}}

    def known(path="one.fmu", alike=(), **changes):
        fmus = {"ship": content["fmus"]["ship"] | {"path": path}}
        return Job(content | {"fmus": fmus} | changes, [path], len, dict.fromkeys(alike, "x")).hash

    assert known(name="b", log={"every": 2}, native=False) == known()
    assert len({known(), known("two.fmu"), known(stop=2.0), known(alike=["one.fmu"])}) == 4
    assert known(alike=["one.fmu", "two.fmu"]) == known("two.fmu", alike=["one.fmu", "two.fmu"])
    assert known(alike=["two.fmu"]) == known()


def everything(run):
    return (
        run.status,
        run.message,
        run.metrics,
        {name: column.copy() for name, column in run.log.items()},
    )


def test_log_and_metrics_in_memory_are_those_of_a_folder(short, tmp_path):
    other = {**short, "seed": 8}
    kept = tmp_path / "kept"
    finished = []
    found = analyse_runs(
        [short, other, other],
        everything,
        [None, None, kept],
        workers=0,
        advance=lambda: finished.append(1),
    )
    assert len(finished) == 3
    for content, (status, _, metrics, log) in zip([short, other, other], found, strict=True):
        result = cosim.simulate(cosim.load_scenario(content), tmp_path / "fresh")
        written = cosim.read_log(tmp_path / "fresh")
        assert (status, metrics) == ("done", result.metrics)
        assert list(log) == list(written)
        assert all(np.array_equal(log[name], written[name], equal_nan=True) for name in log)
    assert (kept / "log.csv").read_bytes() == (tmp_path / "fresh" / "log.csv").read_bytes()


def test_a_failed_run_has_its_message_and_its_log(short, plain_fmu):
    init = "self.y = 0.0\nself.register_variable(Real('y', causality=Fmi2Causality.output))"
    step = "self.y += h\nif t > 0.5: raise ValueError('too much')\nreturn True"
    short["fmus"]["ramp"] = {"path": str(plain_fmu("Breaks", init, step))}
    short["log"] = {"signals": ["ramp.y"]}
    [(status, message, _, log)] = analyse_runs([short], everything)
    assert status == "failed"
    assert message.startswith("ramp: the step from t = 0.51 s returned")
    assert log["ramp.y"][-1] == pytest.approx(log["time"][-1])
    assert log["time"][-1] == 0.51


def refuse(run):
    run.demand()
    raise RuntimeError("nothing to see")


def test_an_interrupt_after_the_last_step_is_one(plain_fmu):
    init = "self.y = 1.0\nself.register_variable(Real('y', causality=Fmi2Causality.output))"
    fmus = {"one": {"path": str(plain_fmu("One", init, "return True"))}}
    scenario = cosim.load_scenario({"name": "one", "step": 0.1, "stop": 0.2, "fmus": fmus})
    with closing(InstancePool()) as pool, pytest.raises(KeyboardInterrupt):
        measured_run.run_in_memory(pool, scenario, keep=lambda _: signal.raise_signal(signal.SIGINT))


def test_what_an_analysis_raises_arrives(short):
    with pytest.raises(RuntimeError, match="nothing to see"):
        analyse_runs([short], refuse)


def test_a_mistake_in_a_scenario_is_told(short):
    short["fmus"]["vessel"]["parameters"]["mm"] = 1.0
    with pytest.raises(cosim.InputError, match="did you mean 'm'"):
        analyse_runs([short], everything)
