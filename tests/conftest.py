"""What several tests share: the built FMUs, scenarios to vary, and how the tests are spread over processes."""

import gc
import hashlib
import json
import os
import signal
import sys
from collections.abc import Mapping
from functools import cache, partial
from pathlib import Path
from types import SimpleNamespace

import pytest
from fmpy.fmi2 import FMU2Slave
from hypothesis import settings
from support.command import command, main_of
from support.opened import Opened
from support.plain import make_fmu, ramp_and_gain, with_unit
from support.processes import one_process, two_processes
from support.project import COMPONENTS, ROOT
from support.shared import keep_in, kept, once, shared_folder
from support.slow_tests import NODE, PROCESSOR, slow_tests

from cosim.dispatch import analyse_runs
from cosim.fmu import FmuModel, LocalInstance, archive_check, fmu_model
from cosim.master import loop_surroundings
from cosim.system import own_fmus
from cybership.user_cache import cache_folder
from fmus.build import build
from fmus.build.platforms import native_targets

# The clock of one example tells what else the machine does, and what traces the test.
EXAMPLES = (
    40  # of a property, in place of 100: a mistake that one in ten shows is missed once in seventy
)
settings.register_profile("by no clock", deadline=None, max_examples=EXAMPLES)
settings.load_profile("by no clock")

# New objects after which the young ones are searched for garbage, in place of 700: modules of tests, traces and
# syntax trees are made by the ten thousands, and stay.
YOUNG = 30_000

# Reasons to skip that are no matter of what is installed; with CYBERSHIP_REQUIRE=all any other one fails.
ACCEPTED = (
    "no measured runs",
    "no FMUs of other tools",
    "not for FMI 2.0",
    "not in the extra dev",
    "no binary for",
    "not on Windows",
    "root may write",
)


def pytest_configure(config):
    """Settings of this process, and through the environment of the workers and of what the tests start.

    A shell that starts the tests in the background makes them deaf to Ctrl-C. Without byte code on the disk,
    each of the hundreds of processes compiles the project anew. Users' output is buffered.
    """
    for name in ("PYTHONDONTWRITEBYTECODE", "PYTHONUNBUFFERED"):
        os.environ.pop(name, None)
    sys.dont_write_bytecode = (
        False  # else each worker rewrites the assertions of all tests in each session
    )
    if getattr(config.option, "numprocesses", None):
        os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # the worker processes take the cores
    gc.set_threshold(YOUNG)
    if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
        signal.signal(signal.SIGINT, signal.default_int_handler)


@pytest.hookimpl(wrapper=True)
def pytest_collection_modifyitems(items):
    """Tests that took long are marked slow, and their files go first: none is left alone at the end.

    The tests of a file stay together, so that mostly one worker makes what they share.
    """
    listed = slow_tests()
    for item in items:
        stays = any(item.get_closest_marker(name) for name in ("numerical", "quick"))
        if item.nodeid in listed and not stays:
            item.add_marker("slow")
    yield
    slow = [item.get_closest_marker("slow") is not None for item in items]
    first = {item.path for item, is_slow in zip(items, slow, strict=True) if is_slow}
    items.sort(key=lambda item: item.path not in first)


@pytest.hookimpl(wrapper=True)
def pytest_runtest_call(item):
    """Processor time of a test [s], its processes included, for ``--junitxml``: other work hardly changes it."""
    before = os.times()
    try:
        return (yield)
    finally:
        used = sum(os.times()[:4]) - sum(before[:4])
        item.user_properties += [(PROCESSOR, f"{used:.2f}"), (NODE, item.nodeid)]


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config, log):
    """A worker that has finished takes tests from another one, unless ``--dist`` says otherwise."""
    if config.getvalue("dist") != "load":
        return None
    from xdist.scheduler import WorkStealingScheduling

    return WorkStealingScheduling(config, log)


def pytest_collection_finish():
    """The tests and their modules stay to the end: no search for garbage goes through them."""
    gc.collect()
    gc.freeze()


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport():
    """An unexpected skip fails where all tools must be installed, as on the machine of the gate."""
    report = yield
    if (
        report.skipped
        and isinstance(report.longrepr, tuple)
        and os.environ.get("CYBERSHIP_REQUIRE") == "all"
    ):
        reason = report.longrepr[2].removeprefix("Skipped: ")
        if not reason.startswith(ACCEPTED):
            report.outcome, report.longrepr = "failed", f"CYBERSHIP_REQUIRE=all, but skipped: {reason}"
    return report


@pytest.fixture
def scenario(ellipse, tmp_path):
    """A function that writes a varied scenario and returns its path."""

    def write(**changes):
        path = tmp_path / "scenario.json"
        path.write_text(json.dumps(ellipse | changes))
        return path

    return write


@pytest.fixture(scope="session")
def shared(tmp_path_factory):
    """A folder that all worker processes of this session see."""
    return shared_folder(tmp_path_factory)


@pytest.fixture(autouse=True, scope="session")
def _session_cache(shared):
    """FMUs and results are made once for all worker processes, and not into the user's cache."""
    keep_in(shared)
    os.environ["CYBERSHIP_CACHE"] = str(shared / "cache")


@pytest.fixture(autouse=True, scope="session")
def _first_library(_session_cache):
    """The first pythonfmu library of a process is one that the master finalises (see Component.free).

    It is opened before the first FMU of the process, as most files of tests open none.
    """
    opens = FMU2Slave.__init__

    def opened(slave, *arguments, **options):
        patch.undo()
        model = FmuModel(build(["vessel"])[0])
        LocalInstance("first", model, print).free()
        model.close()
        opens(slave, *arguments, **options)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(FMU2Slave, "__init__", opened)
        yield


class BuiltFmus(Mapping[str, Path]):
    """Name -> path of every FMU of the project, each built when it is first asked for."""

    def __init__(self):
        self._paths = {}

    def __getitem__(self, name):
        if name not in COMPONENTS:
            raise KeyError(name)
        if name not in self._paths:
            (self._paths[name],) = build([name])
        return self._paths[name]

    def __iter__(self):
        return iter(COMPONENTS)

    def __len__(self):
        return len(COMPONENTS)


@pytest.fixture(scope="session")
def fmus(_session_cache):
    return BuiltFmus()


@pytest.fixture(scope="session")
def native(_session_cache):
    """Name -> path of the native FMUs of scenarios/ellipse.json."""
    names = ["vessel", "thrusters", "observer_mdf", "guidance_ellipse", "controller_abs"]
    return {path.stem: path for path in build(names, native=native_targets())}


@pytest.fixture
def opened_here(tmp_path):
    """A function that opens an FMU in the test's folder; closed after the test."""
    instances = []

    def make(path, name="instance"):
        instances.append(Opened(path, tmp_path, name))
        return instances[-1]

    yield make
    for instance in instances:
        instance.close()


@pytest.fixture(autouse=True, scope="session")
def _ask_the_builder_once(_session_cache):
    """Scenarios that this process loads build an FMU once, not at each load, and in this process.

    Processes that the tests start, and tests with a cache of their own, ask it as always.
    """
    ask, cache, known = own_fmus.run_builder, cache_folder(), {}
    here = SimpleNamespace(run=lambda line, **_: command(main_of(line[2]), *line[3:]))

    def builder(*arguments, warnings=None):
        after = arguments.index("--") + 1
        options, names = arguments[:after], arguments[after:]
        described = any(option.endswith(".toml") for option in options)  # a file that may change
        if described or cache_folder() != cache:
            return ask(*arguments, warnings=warnings)
        of_these = known.setdefault(options, {})
        if missing := [name for name in names if name not in of_these]:
            with pytest.MonkeyPatch.context() as inner:
                inner.setattr(own_fmus, "subprocess", here)
                built = ask(*options, *missing, warnings=warnings)
            of_these.update(zip(missing, built, strict=True))
        return [of_these[name] for name in names]

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(own_fmus, "run_builder", builder)
        yield


@pytest.fixture(autouse=True, scope="session")
def _unpack_once(shared):
    """Our FMUs are read once by a process, and unpacked once for all, where their byte code stays, too."""
    own, unpack, read = cache_folder(), FmuModel.unpack, fmu_model.read_model_description
    described = cache(lambda path, _, **options: read(path, **options))

    def unpacked(model):
        if model._folder is None and own in model.path.parents:
            content = hashlib.sha256(model.path.read_bytes()).hexdigest()[:16]
            model._folder = once(
                shared / f"unpacked_{content}", partial(archive_check.unpack, model.path)
            )
            model._owns_folder = False
        return unpack(model)

    def description(path, **options):
        if own not in Path(path).parents:
            return read(path, **options)
        return described(path, os.stat(path).st_mtime_ns, **options)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(FmuModel, "unpack", unpacked)
        patch.setattr(fmu_model, "read_model_description", description)
        yield


@pytest.fixture(autouse=True, scope="session")
def _collect_young_garbage_only():
    """Before each run the master collects all garbage; here that of hundreds of tests would be searched."""
    functions = {name: getattr(gc, name) for name in dir(gc) if not name.startswith("_")}
    light = SimpleNamespace(**functions | {"collect": partial(gc.collect, 1)})
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(loop_surroundings, "gc", light)
        yield


@pytest.fixture
def serial(monkeypatch):
    """Runs of a study one after the other in this process; test_studies.py covers several processes."""

    def here(scenarios, analyse, folders, _, advance):
        return analyse_runs(scenarios, analyse, folders, 0, advance)

    monkeypatch.setattr("thesis.monte_carlo.analyse_runs", here)


@pytest.fixture(autouse=True, scope="session")
def _diagnosis_in_one_process():
    with one_process():
        yield


@pytest.fixture(name="two_processes")
def _two_processes():
    """The diagnosis shares its work with a second process, as outside of the tests."""
    with two_processes():
        yield


@pytest.fixture(autouse=True, scope="session")
def _smooth_once(shared):
    """A measured run that several tests read is smoothed once; test_diagnosis_smoothing.py smooths itself."""
    from diagnosis.runs import prepared_run, smooth

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(prepared_run, "smooth", lambda track, agreeing: kept(smooth, track, agreeing))
        yield


@pytest.fixture(autouse=True, scope="session")
def _short_loops():
    """The closed loops of the check of a learned model last 30 s; test_diagnosis_stability.py has whole ones."""
    from diagnosis.assessment import stability

    short = tuple(r._replace(seconds=30.0) for r in stability.REFERENCES)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(stability, "REFERENCES", short)
        yield


@pytest.fixture
def ellipse():
    """The content of scenarios/ellipse.json, cut to 2 s, to be varied."""
    content = json.loads((ROOT / "scenarios" / "ellipse.json").read_text())
    content["stop"] = 2.0
    content["metrics"] = {}
    return content


@pytest.fixture
def plain_fmu(tmp_path):
    """A function that makes an FMU with plain pythonfmu: ``make_fmu`` in the folder of the test."""
    return partial(make_fmu, tmp_path)


@pytest.fixture
def portable(ellipse):
    """The ellipse scenario without what cannot travel."""
    return ellipse | {"faults": [], "algorithm": "jacobi", "stop": 0.5}


@pytest.fixture
def own(portable):
    """The same with parameters of its own."""
    portable["fmus"]["vessel"]["parameters"] |= {"x_0": 4.5, "delta_X_u": -3.0}
    return portable


@pytest.fixture
def chain(plain_fmu):
    """Two foreign FMUs: a ramp, and a gain with a parameter that only it knows."""
    return ramp_and_gain(plain_fmu)


@pytest.fixture
def angles(plain_fmu):
    """The same, where the ramp is in degrees and the gain in radians."""
    degrees = with_unit("deg", 'rad="1" factor="0.017453292519943295"')
    return ramp_and_gain(plain_fmu, degrees, with_unit("rad", 'rad="1"'))
