"""FMUs that are not there, and calls of the life cycle that fail."""

from types import SimpleNamespace

import pytest
from fmpy.fmi1 import FMICallException

from cosim import InputError, SimulationError
from cosim.fmu import local
from cosim.fmu.fmu_model import FmuModel


def test_an_fmu_that_is_not_there_has_a_hint(tmp_path):
    with pytest.raises(InputError, match="'cybership build NAME --out DIR' writes one"):
        FmuModel(tmp_path / "vessel.fmu")
    (tmp_path / "vessel.fmu").touch()
    with pytest.raises(InputError, match=r"did you mean 'vessel\.fmu'") as refused:
        FmuModel(tmp_path / "vesel.fmu")
    assert "cybership build" not in str(refused.value)


@pytest.mark.parametrize(
    ("status", "before", "after"), [(4, 0, 4), (2, 0, 2), (2, 3, 3), (None, 0, local.ERROR)]
)
def test_the_worst_status_of_failed_calls_is_kept(status, before, after):
    component = SimpleNamespace(complaint="", worst_status=before)
    made = SimpleNamespace(
        component=component,
        name="vessel",
        model=SimpleNamespace(path=SimpleNamespace(name="vessel.fmu")),
    )

    def fails():
        component.complaint = "no fuel"
        raise FMICallException("doStep", status) if status is not None else OSError("gone")

    with pytest.raises(SimulationError, match=r"vessel \(vessel.fmu\): set-up failed: .*: no fuel"):
        local.LocalInstance._call(made, "set-up", fails)
    assert component.worst_status == after
