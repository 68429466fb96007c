"""Help for the tests of what goes to other tools and comes from them."""

import importlib

import pytest

import cosim
from cosim.scenario import load_scenario
from cosim.system import prepare

NEEDS = {
    "libcosim_ssp": ("libcosimpy.CosimExecution", "libcosimpy"),
    "libcosim_osp": ("libcosimpy.CosimExecution", "libcosimpy"),
    "ecos": ("ecospy.EcosSimulation", "ecospy and the TBB library"),
    "fmpy": ("fmpy.ssp.simulation", "fmpy"),
    "container_jacobi": ("fmu_manipulation_toolbox.container", "fmu-manipulation-toolbox"),
    "container_gauss_seidel": ("fmu_manipulation_toolbox.container", "fmu-manipulation-toolbox"),
}


def need(case):
    module, what = NEEDS[case]
    try:
        importlib.import_module(module)
    except (ImportError, OSError) as error:
        pytest.skip(f"needs {what}: {error}")


def write(content, path, how, drop=False):
    system = prepare(load_scenario(content))
    try:
        return how(system, path, drop, overwrite=True)
    finally:
        system.close()


def log_of(source, folder, **changes):
    result = cosim.simulate(load_scenario(source, changes), folder)
    assert result.status == "done", result.message
    return result, (result.folder / "log.csv").read_text()
