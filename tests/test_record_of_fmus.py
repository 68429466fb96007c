"""What a validation record says of an FMU that integrates roughly inside, or that looks for the measurement."""

import json
import sys

import numpy as np
import pytest
from support.acceptance import validated
from support.foreign import needs_compiler
from support.measured import csv_of, sail

import diagnosis
from benchmarks.foreign_parameters.c_fmu import CSystem, Quantity, build_c_fmu
from diagnosis import Fmu
from diagnosis.acceptance import lines
from diagnosis.acceptance.budget import sources_of
from diagnosis.acceptance.predictions import Predictions, difference, judged
from diagnosis.predictors.predictor import Execution

pytestmark = needs_compiler

SHIP = CSystem(
    inputs={"tau_X": Quantity(0.0, "N"), "tau_Y": Quantity(0.0, "N"), "tau_N": Quantity(0.0, "N.m")},
    states={
        "x": Quantity(0.0, "m"), "y": Quantity(0.0, "m"), "psi": Quantity(0.0, "rad"),
        "u": Quantity(0.0, "m/s"), "v": Quantity(0.0, "m/s"), "r": Quantity(0.0, "rad/s"),
    },
    parameters={},
    equations="""der_x = u * cos(psi) - v * sin(psi); der_y = u * sin(psi) + v * cos(psi); der_psi = r;
    der_u = (tau_X - 2.0 * u) / 17.0; der_v = (tau_Y - 9.0 * v) / 25.0; der_r = (tau_N - 2.0 * r) / 2.8;""",
)  # fmt: skip
# An explicit Euler method in steps of its own, no longer than INNER.
EULER = """int parts = (int)ceil(h / INNER - 1e-9);
    for (int k = 0; k < parts; k++) { slope(p);
        for (int i = 0; i < 6; i++) p[V_x + i] += h / parts * p[V_der_x + i]; }
    slope(p); return 0;"""
# It looks for the run, finds its own place in it, and plays it back.
THIEF = r"""static double seen[20000][4]; static int rows = -1, own = 0;
    if (rows < 0) {
        FILE *file = fopen("TARGET", "r"); char line[400]; double nearest = 1e9; rows = 0;
        while (file && fgets(line, sizeof line, file))
            if (sscanf(line, "%lf,%lf,%lf,%lf", seen[rows], seen[rows] + 1, seen[rows] + 2, seen[rows] + 3) == 4) {
                double off = hypot(seen[rows][1] - p[V_x], seen[rows][2] - p[V_y]);
                if (off < nearest) { nearest = off; own = rows; } rows++; }
        if (file) fclose(file);
    }
    if (rows > 0) {
        int k = own; double at = seen[own][0] + t + h;
        while (k < rows - 2 && seen[k + 1][0] < at - 1e-9) k++;
        double part = (at - seen[k][0]) / (seen[k + 1][0] - seen[k][0]);
        p[V_x] = seen[k][1] + part * (seen[k + 1][1] - seen[k][1]);
        p[V_y] = seen[k][2] + part * (seen[k + 1][2] - seen[k][2]);
        p[V_psi] = seen[k + 1][3];
        return 0;
    }"""
NAMES = {n: n for n in ("x", "y", "psi", "u", "v", "r")}
MAP = {"inputs": {n: n for n in SHIP.inputs}, "outputs": NAMES, "start": {n: f"{n}0" for n in NAMES}}


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    return csv_of(sail(40.0, h=0.1)[0], tmp_path_factory.mktemp("run") / "a.csv")


def compared(run, folder, name, habit="", **execution):
    """A comparison of an FMU of the ship with the run."""
    given = folder / "map.json"
    given.write_text(json.dumps(MAP))
    fmu = build_c_fmu(folder, name, SHIP, habit)
    return diagnosis.compare(run, model=Fmu(fmu, given, execution=Execution(**execution)))


def predicted(comparison):
    return Predictions(comparison.evaluations[0], 4.0)


@pytest.mark.slow
def test_u_num_of_an_euler_method_that_follows_the_step_is_its_error(run, tmp_path):
    p = predicted(compared(run, tmp_path, "euler", EULER.replace("INNER", "1.0")))
    true = difference(p.motion, predicted(compared(run, tmp_path, "exact")).motion)
    error = np.sqrt(np.mean(judged("position", true) ** 2))
    assert error > 1e-4
    found = sources_of(p, None)
    assert np.sqrt(np.mean(found["numerical"]["position"])) == pytest.approx(error, rel=0.05)


@pytest.mark.slow
@pytest.mark.parametrize("inner", [0.005, 0.0075])
def test_u_num_of_an_euler_method_with_steps_of_its_own_is_not_known(run, tmp_path, inner):
    """Halving the step does not act on its steps, or on the first time alone."""
    found = sources_of(
        predicted(compared(run, tmp_path, "euler", EULER.replace("INNER", str(inner)))), None
    )
    assert isinstance(found["numerical"], str)
    assert "the predictions of euler.fmu do not converge" in found["numerical"]


@pytest.mark.slow
def test_u_num_of_a_container_is_not_known(run, tmp_path):
    """Of a system that is made one FMU, the step is its own."""
    inner = build_c_fmu(tmp_path, "euler", SHIP, EULER.replace("INNER", "1e9"))
    content = {"name": "system", "step": 0.1, "stop": 10.0, "fmus": {"ship": {"path": str(inner)}}}
    (tmp_path / "system.json").write_text(json.dumps({**content, "connections": []}))
    given = {g: {s: f"ship.{n}" for s, n in names.items()} for g, names in MAP.items()}
    (tmp_path / "map.json").write_text(json.dumps(given))
    c = diagnosis.compare(run, model=Fmu(tmp_path / "system.json", tmp_path / "map.json"))
    (j,) = validated(c, tmp_path, {"tolerance": 50.0}).content.judgements
    assert j.budget.u_num is None
    assert "numerical" in j.reason


@pytest.mark.slow
@pytest.mark.parametrize("confined", [True, False])
def test_an_fmu_that_looks_for_the_measurement_is_said_in_the_record(run, tmp_path, confined):
    c = compared(run, tmp_path, "thief", THIEF.replace("TARGET", str(run)), confined=confined)
    v = validated(c, tmp_path, {"tolerance": 0.05, "coverage": 0.7})
    (j,) = v.content.judgements
    assert v.content.confinement.startswith("unconfined") != confined
    if sys.platform == "linux":
        assert str(run) in v.content.fmu["outside"]
    if confined:
        assert j.outcome != "met"
        return
    assert j.outcome == "met", "it plays the run back"
    stated = " ".join(lines(v.content))
    assert "unconfined" in stated
    assert sys.platform != "linux" or f"files outside of its own: {run}" in stated
