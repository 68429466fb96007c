"""How large a force on an input of a system usually is: what drives the input, in its unit."""

from types import SimpleNamespace

import numpy as np
import pytest

from diagnosis.fmu_parameters.system_task import SystemTask


def usual(inputs, columns, forces=("thrust",)):
    runs = {"train": [SimpleNamespace(columns={n: np.array(x) for n, x in c.items()}) for c in columns]}
    mapped = {n: SimpleNamespace(name=v, factor=f, offset=o) for n, (v, f, o) in inputs.items()}
    task = SimpleNamespace(forces_on=forces, map=SimpleNamespace(inputs=mapped), runs=runs)
    return SystemTask.usual.fget(task)


def test_it_is_the_root_mean_square_of_all_training_runs_in_the_unit_of_the_input():
    columns = [{"X [kN]": [1.0, -1.0]}, {"X [kN]": [3.0, np.nan]}]
    found = usual({"X [kN]": ("thrust", 1000.0, 500.0)}, columns)
    assert found == {"thrust": pytest.approx(np.sqrt(np.mean(np.square([1500.0, -500.0, 3500.0]))))}


@pytest.mark.parametrize("inputs", [{}, {"n": ("speed", 1.0, 0.0)}, {"n": ("thrust", 1.0, 0.0)}])
def test_it_is_one_of_an_input_that_nothing_drives(inputs):
    assert usual(inputs, [{"n": [0.0, 0.0]}]) == {"thrust": 1.0}
