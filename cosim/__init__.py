"""A co-simulation master for FMI 2.0: connects FMUs, injects faults, logs, measures.

It reads ``.fmu`` files and knows nothing of what is inside them. ``python -m cosim.run SCENARIO``
runs a scenario; from Python::

    import cosim

    result = cosim.simulate("ellipse", seed=3, set={"vessel.m": 15.0})
    result.metrics["e_pos_rms"]  # m
    result.log["vessel.x"]  # a column of a table, whose attrs["units"] tell its unit
    result.plot("errors").save("errors.svg")

The packages below, each using only those before it: ``compiled`` (C for the step loop and the log),
``fmu`` (one FMU), ``formats`` (files of the SSP and OSP standards), ``scenario`` (the user's input),
``system`` (a scenario checked against its FMUs), ``results`` (log, metrics, pictures), ``trials``
(manoeuvring trials and their measures), ``master`` (the run), ``dispatch`` (runs in many processes),
``campaign`` (many runs and their table), ``export`` (systems for other tools).
"""

from .lazy import lazy_names

TYPE_CHECKING = False  # typing itself takes a while to import
if TYPE_CHECKING:
    from .campaign.conduct import run_campaign
    from .conversion import BASE_UNITS, Unit
    from .errors import InputError, SimulationError
    from .files import atomic_write
    from .formats.ssv import Parameter, ParameterSet, read_parameters, write_parameters
    from .master.ending import Result
    from .results.log import read_log
    from .results.log_frame import log_frame
    from .scenario.load import load_scenario
    from .scenario.schema import Scenario
    from .scenario.shipped import shipped_folder, shipped_names
    from .simulating import simulate

__all__ = [
    "BASE_UNITS",
    "InputError",
    "Parameter",
    "ParameterSet",
    "Result",
    "Scenario",
    "SimulationError",
    "Unit",
    "atomic_write",
    "load_scenario",
    "log_frame",
    "read_log",
    "read_parameters",
    "run_campaign",
    "shipped_folder",
    "shipped_names",
    "simulate",
    "write_parameters",
]

__getattr__ = lazy_names(
    __name__,
    {
        "BASE_UNITS": "conversion",
        "InputError": "errors",
        "Parameter": "formats.ssv",
        "ParameterSet": "formats.ssv",
        "Result": "master.ending",
        "Scenario": "scenario.schema",
        "SimulationError": "errors",
        "Unit": "conversion",
        "atomic_write": "files",
        "load_scenario": "scenario.load",
        "log_frame": "results.log_frame",
        "read_log": "results.log",
        "read_parameters": "formats.ssv",
        "run_campaign": "campaign.conduct",
        "shipped_folder": "scenario.shipped",
        "shipped_names": "scenario.shipped",
        "simulate": "simulating",
        "write_parameters": "formats.ssv",
    },
)


def __dir__() -> list[str]:
    """The public names, also those that are not imported yet."""
    return sorted(__all__)
