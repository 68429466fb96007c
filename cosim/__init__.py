"""A co-simulation master for FMI 2.0: connects FMUs, injects faults, logs, measures.

It reads ``.fmu`` files and knows nothing of what is inside them. ``python -m cosim.run SCENARIO``
runs a scenario; from Python::

    import cosim

    result = cosim.simulate(cosim.load_scenario("scenarios/ellipse.json"), "results/ellipse")
    log = cosim.read_log(result.folder)
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from .errors import InputError, SimulationError
    from .files import whole
    from .log import read_log
    from .scenario import Scenario, load_scenario
    from .simulation import Result, simulate
    from .ssv import Parameter, ParameterSet, read_parameters, write_parameters

__all__ = [
    "InputError",
    "Parameter",
    "ParameterSet",
    "Result",
    "Scenario",
    "SimulationError",
    "load_scenario",
    "read_log",
    "read_parameters",
    "simulate",
    "whole",
    "write_parameters",
]

_HOME = {
    "InputError": "errors",
    "SimulationError": "errors",
    "read_log": "log",
    "Scenario": "scenario",
    "load_scenario": "scenario",
    "Result": "simulation",
    "simulate": "simulation",
    "Parameter": "ssv",
    "ParameterSet": "ssv",
    "read_parameters": "ssv",
    "whole": "files",
    "write_parameters": "ssv",
}


def __getattr__(name: str) -> Any:
    """Import on demand, so that a command pays only for what it uses."""
    if name not in _HOME:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f".{_HOME[name]}", __name__), name)
