"""The checker: each rule fires on an FMU that breaks it, none on ours nor on one without a fault."""

import json
import logging
import os
import stat
import subprocess
import sys
import zipfile
from dataclasses import replace
from functools import cache
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from types import SimpleNamespace
from xml.etree import ElementTree

import pytest
from support import ccode, lag
from support.command import command
from support.plain import GAIN
from support.project import COMPONENTS, ROOT

from fmucheck import checking, report, source, trial
from fmucheck.api import InstanceOnTrial, Library
from fmucheck.checking import main
from fmucheck.description import FmuDescription
from fmucheck.examine import examine
from fmucheck.fmu import FmuArchive
from fmucheck.fmu_on_trial import FmuOnTrial, near, other, same
from fmucheck.registry import RULES, NotApplicableError, Outcome, in_order
from fmucheck.report import listing
from fmucheck.source import BadFileError
from fmus.build.packing import sources
from fmus.declare import discover
from fmus.ship import ship

READING = [rule.name for rule in in_order() if not rule.runs]
RUNNING = [rule.name for rule in in_order() if rule.runs]
LIGHT = ("vessel", "observer_mdf", "controller_bs", "guidance_ellipse")  # run in the quick part
# One of each kind of memory; those left out differ from one of them by parameters or by a law.
OTHERS = (
    "thrusters_propeller", "observer_kalman", "controller_cl_svd_z2", "controller_cl_win_eps",
    "guidance_waypoints", "watch_thrusters",
)  # fmt: skip
compiled = pytest.mark.skipif(ccode.COMPILER is None, reason="no C compiler on this machine")


@pytest.fixture(autouse=True, scope="module")
def _one_schema():
    """The toolbox would read the schema of FMI anew for each FMU, which takes longer than to check it."""
    with pytest.MonkeyPatch.context() as patch:
        if find_spec("fmu_manipulation_toolbox") is not None:
            checker = import_module("fmu_manipulation_toolbox.checker")
            schema = cache(checker.xmlschema.XMLSchema)
            patch.setattr(checker, "xmlschema", SimpleNamespace(XMLSchema=schema))
        yield


def found(path, *names, timeout=30.0):
    """Name of the rule -> what it found; rules that say nothing are left out."""
    outcomes = examine(FmuArchive(path), [RULES[name] for name in names or RULES], timeout)
    return {name: outcome.found for name, outcome in outcomes.items() if outcome.found}


def member(name, mode=0o644, compressed=zipfile.ZIP_STORED):
    info = zipfile.ZipInfo(name)
    info.create_system, info.external_attr, info.compress_type = 3, mode << 16, compressed
    return info


U = '<ScalarVariable name="in.u[1]" valueReference="0" causality="input"><Real declaredType="Speed" start="0"/></ScalarVariable>'
T = '<Real unit="s" start="1" min="0.01" nominal="1"/>'

# Rule, edits of the description, what the rule says.
BROKEN = [
    ("base-units", [('m="1" s="-1"', 'm="1" s="1"')], "exponent of s is 1, not -1"),
    ("base-units", [('m="1" s="-1"', 'm="1" s="-1" factor="0.5"')], "has a factor"),
    ("units-defined", [('<Real unit="s" ', '<Real unit="h" ')], "unit 'h' is not defined"),
    ("units-defined", [('displayUnit="km/h"', 'displayUnit="mph"')], "'mph' of 'm/s' is not defined"),
    ("units-defined", [('<Real unit="s" ', '<Real displayUnit="h" ')], "without a unit"),
    ("start", [('declaredType="Speed" start="0"', 'declaredType="Speed"')], "has no start value"),
    ("start", [('initial="calculated"><Real', 'initial="calculated"><Real start="1"')], "though it is calculated"),
    ("start", [('start="0"', 'start="NaN"')], "not a finite Real"),
    ("limits", [('min="0.01"', 'min="2"')], "outside of 2"),
    ("limits", [('min="0.01"', 'min="2" max="0"')], "min 2, max 0"),
    ("limits", [('nominal="1"', 'nominal="0"')], "nominal is '0'"),
    ("limits", [('declaredType="Mode" start="1"', 'declaredType="Mode" start="3"')], "start 3 is not an item"),
    ("dependencies", [('dependencies="1" dependenciesKind', 'dependencies="2" dependenciesKind')], "depends on T"),
    ("dependencies", [('dependenciesKind="constant"', 'dependenciesKind="tunable"')], "allowed at initialisation"),
    ("dependencies", [('dependencies="1 2"', 'dependencies="1 4"')], "depends on direct, which is not known"),
    ("xsd", [("<VendorAnnotations>", "<Surprise/><VendorAnnotations>")], "Surprise"),
    ("fmpy", [('name="direct"', 'name="y"')], "not unique"),
    ("fmpy", [('causality="parameter" variability="fixed"', 'causality="parameter"')], "illegal combination"),
    ("fmpy", [('<Outputs><Unknown index="3"', '<Outputs><Unknown index="5"')], "ModelStructure/Outputs"),
    ("fmpy", [('<InitialUnknowns><Unknown index="3" dependencies="2"/>', "<InitialUnknowns>")], "InitialUnknowns"),
    ("fmpy", [('<Unknown index="5"/>', '<Unknown index="5"/><Unknown index="2"/>')], "InitialUnknowns"),
    ("fmpy", [('dependenciesKind="fixed"', 'dependenciesKind="fixed fixed"')], "number of elements"),
    ("fmutool", [('name="direct"', 'name="y"')], "used by several"),
]  # fmt: skip


@pytest.mark.parametrize(("rule", "edits", "text"), BROKEN)
def test_each_rule_fires_on_a_description_that_breaks_it(rule, edits, text, tmp_path):
    if rule == "fmutool":
        pytest.importorskip("fmu_manipulation_toolbox")
    said = found(lag.pack(tmp_path, edits, compiled=False), rule)
    assert any(text in line for line in said[rule]), said


def test_a_toolbox_that_was_silenced_is_heard(tmp_path):
    pytest.importorskip("fmu_manipulation_toolbox")
    logging.getLogger("fmu_manipulation_toolbox").setLevel(logging.CRITICAL)
    assert found(lag.pack(tmp_path, [('name="direct"', 'name="y"')], compiled=False), "fmutool")[
        "fmutool"
    ]


def test_a_description_without_a_fault_passes(tmp_path):
    assert found(lag.pack(tmp_path, compiled=False), *READING) == {}


@pytest.mark.parametrize(
    ("member", "text"),
    [("../evil", "leads out of the folder"), ("/etc/evil", "leads out of the folder"), ("a\\b", "backslash"),
     ("C:/evil", "leads out of the folder"),
     (member("resources/link", stat.S_IFLNK | 0o777), "is a link"),
     (member("resources/x", compressed=zipfile.ZIP_BZIP2), "compressed by method 12"), ("sources/lag.c", "occurs 2 times")],
)  # fmt: skip
@pytest.mark.filterwarnings("ignore:Duplicate name")
def test_archive_that_reaches_outside_is_told_and_not_run(member, text, tmp_path):
    path = lag.pack(tmp_path, compiled=False, extra=[(member, "x")])
    outcomes = examine(FmuArchive(path), [RULES["archive"], RULES["life"]])
    assert any(text in line for line in outcomes["archive"].found)
    assert "archive is refused" in outcomes["life"].skipped


def test_missing_library_is_told(tmp_path):
    path = lag.pack(tmp_path, [('modelIdentifier="lag"', 'modelIdentifier="other"')], compiled=False)
    assert any("is missing" in line for line in found(path, "binaries")["binaries"])
    outcomes = examine(FmuArchive(path), [RULES["life"]])
    assert "no binary" in outcomes["life"].skipped


def test_variable_without_a_type_is_told_and_not_run(tmp_path):
    path = lag.pack(tmp_path, [('<Real derivative="3"/>', "")], compiled=False)
    outcomes = examine(FmuArchive(path), [RULES["xsd"], RULES["life"]])
    assert outcomes["xsd"].found
    assert "no type" in outcomes["life"].skipped


STEP = "s->y += h"
TUNABLE = ('"parameter" variability="fixed"', '"parameter" variability="tunable"')
PENDING = ("(s->u - s->y);\n    return 0;", "(s->u - s->y);\n    return 5;")
# Rule, edits of the source, edits of the description, what the rule says.
MISBEHAVING = [
    ("exports", [("fmi2CancelStep", "cancel")], [], "fmi2CancelStep is not exported"),
    ("exports", [('return "2.0"', 'return "1.0"')], [], "fmi2GetVersion returns"),
    ("life", [("return NULL", "return NULL; return NULL"), ('"{lag}"', '"{gal}"')], [], "fmi2Instantiate returned"),
    ("life", [("fmi2Terminate(void *c) {", "fmi2Terminate(void *c) { raise(SIGSEGV);")], [], "fmi2Terminate: the process ended by SIGSEGV"),
    ("life", [(STEP, 'm->callbacks->logger(0, "", 3, "errors", "too much"); return 3; s->y += h')], [], "fmi2DoStep returned error: too much"),
    ("life", [PENDING], [], "fmi2DoStep returned pending"),
    ("life", [(STEP, 'm->callbacks->logger(0, "", 1, "gossip", "hm"); s->y += h')], [], "category 'gossip'"),
    ("free", [("alive--;", "if (!m->s.running) abort(); alive--;")], [], "fmi2FreeInstance: the process ended by SIGABRT"),
    ("logging", [("const char *const k[]) { return 0; }", "const char *const k[]) { return 3; }")], [], "fmi2SetDebugLogging returned error"),
    ("step-size", [(STEP, "if (h < 0.004) return 3; s->y += h")], [], "fmi2DoStep returned error"),
    ("start-values", [("{0.0, 0.0, 1.0, 0.0, 0}", "{0.0, 0.0, 3.0, 0.0, 0}")], [], "T starts at 3.0, not at 1"),
    ("read-back", [("m->s.T = v[k]", "m->s.T = 1.0")], [], "T was set to 1.01 and reads 1"),
    ("range-of-values", [], [('max="50"', 'min="20" max="50"')], "direct is 0, outside of 20 to 50"),
    ("reset", [("begin(c); return 0;", "Lag *m = c; m->s.running = 0; m->s.hidden += 1; return 0;"),
               (STEP, "s->y += s->hidden + h")], [], "differs: y from step 1"),
    ("range-of-values", [(STEP, "s->y += 0.0 / 0.0 * h")], [], "y is nan, which is not finite, at step 1"),
    ("range-of-values", [("v[0] = 1;", "v[0] = 3;")], [('variability="constant"', 'causality="output" variability="discrete"')], "mode is 3, which is not an item"),
    ("reset", [("begin(c);", "double T = ((Lag *)c)->s.T; begin(c); ((Lag *)c)->s.T = T;")], [TUNABLE], "after fmi2Reset T is 1.1, not 1.0"),
    ("state", [("((Lag *)c)->s = *(State *)s", "double u = ((Lag *)c)->s.u; ((Lag *)c)->s = *(State *)s; ((Lag *)c)->s.u = u")], [], "in.u[1] is 0.1, not"),
    ("instances", [("m->s.T = v[k]", "shared = v[k]"), ("double all", "if (shared) s.T = shared; double all")], [TUNABLE], "T is 1.1, not 1.0"),
    ("state", [(STEP, "shared += 1.0; s->y += shared + h")], [], "after fmi2SetFMUstate the run differs"),
    ("serialised-state", [("memcpy(b, s, n)", "memset(b, 0, n)")], [], "the same instance"),
    ("serialised-state", [(STEP, "if (!s->hidden) s->hidden = alive; s->y += s->hidden * h"),
                          ("((Lag *)c)->s = *(State *)s", "double k = ((Lag *)c)->s.hidden; ((Lag *)c)->s = *(State *)s; ((Lag *)c)->s.hidden = k")], [], "a new instance"),
    ("instances", [(STEP, "shared += s->u; s->y += shared + h")], [], "with another instance"),
    ("initial-dependencies", [], [('index="3" dependencies="2"', 'index="3" dependencies="1"')], "y depends on T while initialising"),
    ("step-dependencies", [("double all[] = {s.u, y, s.T, s.T * s.u", "double all[] = {s.u, y, s.T, s.hidden"), (STEP, "s->hidden = s->T * s->u; s->y += h")],
                          [('dependencies="1" dependenciesKind="fixed"', 'dependencies=""')], "direct depends on in.u[1] over a step of no length"),
    ("output-dependencies", [], [('dependencies="1" dependenciesKind="fixed"', 'dependencies=""')], "direct depends on in.u[1] without a step"),
]  # fmt: skip


@compiled
@pytest.mark.parametrize(("rule", "c", "xml", "text"), MISBEHAVING)
def test_each_trial_fires_on_an_fmu_that_breaks_it(rule, c, xml, text, tmp_path):
    said = found(lag.pack(tmp_path, xml, c), rule)
    assert any(text in line for line in said[rule]), said


ABLE = "canHandleVariable"
# Rule, edits of the source, edits of the description, why the rule says nothing (it passes without).
ALLOWED = [
    ("life", [PENDING, ("int *v) { return 2; }\nint fmi2GetReal", "int *v) { static int n; *v = n++ % 3 ? 5 : 0; return 0; }\nint fmi2GetReal")],
             [(ABLE, 'canRunAsynchronuously="true" ' + ABLE)], ""),
    ("read-back", [("vr[k] == 2) m", "vr[k] == 2 && v[k] > 0.0) m")], [(T, '<Real unit="s" start="0.001"/>')], ""),
    ("read-back", [("m->s.T = v[k]", "return 2")], [], "fmi2SetReal returned discard"),
    ("step-size", [(STEP, "if (h > 0.015) return 2; s->y += h")], [], "fmi2DoStep returned discard"),
    ("life", [(', "{lag}")', ', "the tool")')], [(ABLE, 'needsExecutionTool="true" ' + ABLE)], "needsExecutionTool is declared"),
]  # fmt: skip


@pytest.mark.parametrize(
    ("xml", "values"),
    [('<Real start="0.001"/>', [0.001]), ('<Real start="-2" max="0"/>', [-2.0]), ("<Real min='0' max='0.05'/>", [0.0]),
     ('<Integer start="3" max="3"/>', [3, 2]), ('<Boolean start="1"/>', [0, 1]),
     ('<Enumeration declaredType="E" start="7"/>', [2, 7, 9])],
)  # fmt: skip
def test_another_value_is_one_the_variable_may_have(xml, values):
    text = (
        '<m><TypeDefinitions><SimpleType name="E"><Enumeration><Item name="a" value="7"/>'
        '<Item name="b" value="2"/></Enumeration></SimpleType></TypeDefinitions>'
        f"<ModelVariables><ScalarVariable>{xml}</ScalarVariable></ModelVariables></m>"
    )
    (v,) = FmuDescription(ElementTree.fromstring(text)).variables
    for value in values:
        changed = other(v, value)
        assert changed != value
        assert v.limits[0] <= changed <= v.limits[1]
        assert changed in (v.items or [changed])
        assert changed * value >= 0.0


@pytest.mark.parametrize(
    ("xml", "share", "value"),
    [
        ('<Real start="2"/>', 0.5, 2.1),
        ('<Real start="-2"/>', 0.5, -1.9),
        ("<Real/>", 1.0, 0.1),
        ('<Real nominal="50"/>', -0.5, -2.5),
        ('<Real start="2" max="2.05"/>', 1.0, 1.8),
        ('<Real start="2" min="1.99" max="2.01"/>', 1.0, 1.99),
    ],
)
def test_a_value_nearby_is_a_tenth_of_the_start_or_of_the_nominal_away(xml, share, value):
    text = f"<m><ModelVariables><ScalarVariable>{xml}</ScalarVariable></ModelVariables></m>"
    (v,) = FmuDescription(ElementTree.fromstring(text)).variables
    assert near(v, share) == pytest.approx(value)
    if xml == '<Real start="2"/>':
        assert other(v, near(v, 1.0)) == pytest.approx(1.9), "half as far to the other side"
        assert other(v, near(v, -0.5)) == pytest.approx(2.2)


@pytest.mark.parametrize(
    ("attributes", "time"),
    [
        ('startTime="2" stopTime="5" stepSize="0.25"', (2.0, 0.25)),
        ('startTime="2" stopTime="5"', (2.0, 0.03)),
        ('startTime="2" stopTime="5" stepSize="-1"', (2.0, 0.03)),
        ('stepSize="inf"', (0.0, 0.01)),
        ("", (0.0, 0.01)),
    ],
)
def test_step_is_that_of_the_default_experiment_or_a_hundredth_of_it(attributes, time):
    text = f"<m><DefaultExperiment {attributes}/></m>"
    assert FmuDescription(ElementTree.fromstring(text)).time() == pytest.approx(time)


@compiled
@pytest.mark.parametrize(("rule", "c", "xml", "why"), ALLOWED)
def test_what_the_standard_allows_is_no_finding(rule, c, xml, why, tmp_path):
    outcome = examine(FmuArchive(lag.pack(tmp_path, xml, c)), [RULES[rule]], 30.0)[rule]
    assert outcome.found == []
    assert why in outcome.skipped
    assert bool(why) == bool(outcome.skipped)


def test_every_rule_has_a_broken_fmu():
    covered = {case[0] for case in [*BROKEN, *MISBEHAVING]} | {"archive", "binaries"}
    assert covered == set(RULES)


@compiled
def test_an_fmu_in_c_without_a_fault_passes(tmp_path):
    assert found(lag.pack(tmp_path), *RUNNING) == {}


@compiled
def test_hanging_fmu_is_a_finding(tmp_path):
    path = lag.pack(tmp_path, c=[(STEP, "pause(); s->y += h")])
    said = found(path, "life", timeout=1.0)
    assert said == {"life": ["fmi2DoStep: it did not return within 1 s"]}


@compiled
def test_single_instance_per_process_is_respected(tmp_path):
    once = [("canGetAnd", 'canBeInstantiatedOnlyOncePerProcess="true" canGetAnd')]
    path = lag.pack(tmp_path, once, [("alive++;", "if (alive++) abort();"), ("alive--;", "")])
    names = ("life", "step-dependencies", "reset", "state", "serialised-state", "instances", "free")
    outcomes = examine(FmuArchive(path), [RULES[name] for name in names])
    assert {name: o.found for name, o in outcomes.items() if o.found} == {}
    assert "OnlyOncePerProcess" in outcomes["instances"].skipped


@compiled
def test_fmu_without_abilities_is_not_asked_for_them(tmp_path):
    xml = [(f'{name}="true"', "") for name in
           ("canGetAndSetFMUstate", "canSerializeFMUstate", "canHandleVariableCommunicationStepSize")]  # fmt: skip
    path = lag.pack(
        tmp_path,
        xml,
        [("fmi2GetFMUstate(void *c, void **s) {", "fmi2GetFMUstate(void *c, void **s) { abort();")],
    )
    outcomes = examine(
        FmuArchive(path), [RULES[name] for name in ("state", "serialised-state", "step-size")]
    )
    assert all(not o.found and "not declared" in o.skipped for o in outcomes.values())


def test_plain_python_fmu_that_denies_what_its_step_does(plain_fmu):
    lie = [('<Unknown index="2"/>', '<Unknown index="2" dependencies=""/>')]
    gain = plain_fmu("Gain", GAIN, "self.y = 2.0 * self.x\nreturn True", lie)
    assert "y depends on x over a step" in found(gain, "step-dependencies")["step-dependencies"][0]
    integral = plain_fmu("Integral", GAIN, "self.y += h * self.x\nreturn True", lie)
    assert found(integral, "step-dependencies") == {}
    sampled = plain_fmu("Sampled", GAIN, "self.y = 2.0 * self.x\nreturn True",
                        [*lie, ('causality="input"', 'causality="input" variability="discrete"')])  # fmt: skip
    assert found(sampled, "step-dependencies") == {}


def test_plain_python_fmu_with_a_hidden_state_and_a_fatal_step(plain_fmu):
    able = [('canGetAndSetFMUstate="false"', 'canGetAndSetFMUstate="true"')]
    step = "self.memory += self.x\nself.y = self.memory\nreturn True"
    hidden = plain_fmu("Hidden", GAIN + "self.memory = 0.0", step, able)
    assert "differs: y" in found(hidden, "state")["state"][0]
    fatal = plain_fmu("Fatal", GAIN, "raise ValueError('no')")
    assert "fmi2DoStep returned fatal" in found(fatal, "life")["life"][0]


@pytest.mark.parametrize("name", COMPONENTS)
def test_ours_read_well(name, fmus):
    assert found(fmus[name], *READING) == {}


def test_one_of_ours_runs_well(fmus):
    assert found(fmus["guidance_setpoint"], *RUNNING) == {}


def in_this_process(path, folder, *names):
    """As ``found``, of trials that share this process: for FMUs that do no harm."""
    fmu, said = FmuArchive(path), {}
    for name in names:
        fmu.unpack(folder / name)
        bench = FmuOnTrial(
            fmu.description, folder / name, Library(folder / name / fmu.library, lambda _: None)
        )
        try:
            said[name] = list(RULES[name].check(bench))
        except NotApplicableError as reason:
            said[name] = [str(reason)]
    return {name: lines for name, lines in said.items() if lines}


@pytest.mark.parametrize("name", LIGHT)
def test_ours_run_well(name, fmus, tmp_path):
    assert in_this_process(fmus[name], tmp_path, *RUNNING) == {}


def test_each_step_begins_where_the_last_one_ended(fmus, tmp_path, monkeypatch):
    """And the first one of an instance, or after a reset, at the start time, which is zero."""
    steps, step, reset = [], InstanceOnTrial.step, InstanceOnTrial.reset

    def stepped(one, time, size):
        steps.append((time, getattr(one, "now", 0.0)))
        step(one, time, size)
        one.now = time + size

    def begun_anew(one):
        reset(one)
        one.now = 0.0

    monkeypatch.setattr(InstanceOnTrial, "step", stepped)
    monkeypatch.setattr(InstanceOnTrial, "reset", begun_anew)
    names = [name for name in RUNNING if "state" not in name]  # a state has a time
    in_this_process(fmus["guidance_setpoint"], tmp_path, *names)
    assert len(steps) > 100
    assert [times for times in steps if times[0] != pytest.approx(times[1], abs=1e-9)] == []


@pytest.mark.slow
@pytest.mark.parametrize("name", OTHERS)
def test_others_of_ours_run_well(name, fmus, tmp_path):
    assert in_this_process(fmus[name], tmp_path, *RUNNING) == {}


@compiled
def test_one_process_and_one_for_each_trial_find_the_same(tmp_path):
    """In the FMU that each of these trials can outlive."""
    path = lag.pack(tmp_path, c=[(STEP, "shared += s->u; s->y += shared + h")])
    names = ("life", "reset", "instances", "step-dependencies")
    assert in_this_process(path, tmp_path, *names) == found(path, *names) != {}


def run_check(*arguments):
    return command(main, *arguments)


def test_command_tells_findings_with_their_clause(tmp_path):
    path = lag.pack(tmp_path, [('min="0.01"', 'min="2"')], compiled=False)
    only = ("--no-run", "--only", "limits", "--only", "life")
    done = run_check(path, *only)
    assert done.returncode == 1
    assert "limits (FMI 2.0.4, 2.2.7)" in done.stdout
    assert "lag: T: start 1 is outside of 2" in done.stdout
    assert "1 finding in 1 FMU" in done.stdout
    rows = [line.split() for line in done.stdout.splitlines()]
    assert rows[:3] == [["check", "lag"], ["limits", "1"], ["life", "-"]]
    # A file that is no FMU does not take the results of the others away, wherever options stand.
    done = run_check(path, *only, "--json", __file__)
    assert (done.returncode, done.stderr.count("error: ")) == (2, 1)
    stated = json.loads(done.stdout)
    assert stated["findings"] == 1
    assert stated["fmus"][0]["checks"]["limits"]["found"] == ["T: start 1 is outside of 2 to inf"]
    assert stated["fmus"][0]["checks"]["life"]["skipped"]


@pytest.mark.parametrize("columns", [60, 80, 133])
def test_as_many_fmus_stand_side_by_side_as_the_terminal_has_room_for(columns, monkeypatch, capsys):
    monkeypatch.setenv("COLUMNS", str(columns))
    fmus = [SimpleNamespace(path=Path(f"{k}.fmu")) for k in range(200)]
    rules = [RULES[name] for name in ("xsd", "output-dependencies")]
    report.show(fmus, rules, [{rule.name: Outcome() for rule in rules}] * len(fmus))
    tables = [part.splitlines() for part in capsys.readouterr().out.split("check ")[1:]]
    widths = [max(map(len, table[1:3])) for table in tables]
    assert max(widths) <= columns
    assert all(columns - width < len("  199") for width in widths[:-1])


def test_command_is_content_with_a_sound_fmu(tmp_path):
    path = lag.pack(tmp_path, compiled=False)
    done = run_check(path, "--no-run", "--only", "xsd", "--timeout", "0.5", "--jobs", "2")
    assert (done.returncode, done.stderr) == (0, "")
    assert "no findings in 1 FMU" in done.stdout


def test_a_folder_is_not_an_fmu(tmp_path):
    done = run_check(tmp_path, "--no-run", "--only", "xsd")
    assert (done.returncode, done.stderr) == (2, f"error: '{tmp_path}' is a folder, not an FMU\n")


def test_a_reader_that_leaves_is_no_mistake(tmp_path, monkeypatch):
    def leave(*_):
        raise BrokenPipeError

    monkeypatch.setattr(checking, "show", leave)
    path = lag.pack(tmp_path, compiled=False)
    assert (run_check(path, "--no-run", "--only", "xsd").returncode) == 0


def test_the_bar_stays_out_of_what_is_written(tmp_path, monkeypatch):
    """On a terminal, to which the results need not go."""
    monkeypatch.setenv("FORCE_COLOR", "1")
    done = run_check(lag.pack(tmp_path, compiled=False), "--no-run", "--only", "xsd", "--json")
    assert json.loads(done.stdout)["findings"] == 0
    assert "checking" in done.stderr


@pytest.mark.parametrize(
    ("option", "value"),
    [*(("--timeout", value) for value in ("0", "-1", "inf", "nan", "soon")), ("--jobs", "0"), ("--jobs", "1.5")],
)  # fmt: skip
def test_command_wants_positive_numbers(option, value):
    done = run_check(option, value)
    assert done.returncode == 2
    assert f"not '{value}'" in done.stderr


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["nothing.fmu"], "no such FMU"),
        ([__file__], "is not an FMU"),
        (["vesel"], "did you mean 'vessel'"),
        (["vessel", "--only", "reste"], "did you mean 'reset'"),
    ],
)
def test_command_refuses_with_one_line(arguments, message):
    done = run_check(*arguments)
    assert done.returncode == 2
    assert message in done.stderr
    assert len(done.stderr.strip().splitlines()) == 1


@pytest.mark.parametrize(
    ("edit", "message"),
    [
        (('fmiVersion="2.0"', 'fmiVersion="3.0"'), "is for FMI 3.0"),
        (("<?xml", "<!DOCTYPE a [<!ENTITY b 'c'>]><?xml"), "defines entities"),
        (("</fmiModelDescription>", ""), "is not XML"),
        (("CoSimulation", "ModelExchange"), "not for co-simulation"),
        (('"UTF-8"', '"klingon"'), "unknown encoding"),
        (('"UTF-8"', '"gbk"'), "multi-byte encodings"),
        (('<Tool name="here"/>', "<a>" * 100_000 + "</a>" * 100_000), "nests more than 100"),
    ],
)
def test_what_is_no_fmu_for_this_is_refused(edit, message, tmp_path):
    with pytest.raises(BadFileError, match=message):
        FmuArchive(lag.pack(tmp_path, [edit], compiled=False))


@pytest.mark.parametrize(
    ("limit", "message"),
    [({"MOST_ENTRIES": 2}, "holds 3 files, more than 2"), ({"MOST_BYTES": 1000}, "archive bomb"),
     ({"SMALL": 1000, "MOST_RATIO": 0.5}, "archive bomb")],
)  # fmt: skip
def test_archive_that_becomes_too_large_is_refused(limit, message, tmp_path, monkeypatch):
    path = lag.pack(tmp_path, compiled=False)
    for name, value in limit.items():
        monkeypatch.setattr(source, name, value)
    with pytest.raises(BadFileError, match=message):
        FmuArchive(path)


@pytest.mark.parametrize(
    ("packed", "most"),
    [(100, 64 * 2**20), (2**20, 200 * 2**20), (2**30, 4 * 2**30)],
    ids=["small", "by its size", "whatever its size"],
)
def test_archives_may_grow_up_to_a_limit(packed, most):
    path = SimpleNamespace(stat=lambda: SimpleNamespace(st_size=packed))
    half = SimpleNamespace(file_size=most // 2)
    source._limit(path, [half, half])
    with pytest.raises(BadFileError, match="archive bomb"):
        source._limit(path, [half, half, SimpleNamespace(file_size=1)])


def test_a_rule_that_cannot_be_checked_says_why(tmp_path):
    def check(fmu):
        raise NotApplicableError("there is nothing to see")

    rule = replace(RULES["xsd"], name="new", check=check)
    outcome = examine(FmuArchive(lag.pack(tmp_path, compiled=False)), [rule])["new"]
    assert (outcome.found, outcome.skipped, outcome.missing) == ([], "there is nothing to see", False)


@pytest.mark.parametrize(
    ("code", "said"),
    [(0, ""), (3, "with exit code 3"), (-9, "by SIGKILL"), (-99, "by signal 99")],
)
def test_end_of_a_trial_is_told_by_its_code(code, said):
    assert trial._manner(code) == (said and f"the process ended {said}")


def test_absent_tool_is_told(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "fmu_manipulation_toolbox.checker", None)
    path = lag.pack(tmp_path, compiled=False)
    outcome = examine(FmuArchive(path), [RULES["fmutool"]])["fmutool"]
    assert outcome.missing
    assert "fmu-manipulation-toolbox is not installed" in outcome.skipped


def test_documented_rules_are_the_rules():
    assert (ROOT / "docs" / "checks.md").read_text() == listing()
    assert all(rule.demand.endswith(".") and rule.clause for rule in RULES.values())


def test_fmus_do_not_carry_the_checker_and_trials_start_light():
    for module, _ in discover(ship()):
        assert not [inside for inside in sources(module, None, ship()) if inside.startswith("check")]
    heavy = "import sys, fmucheck.child, fmucheck.rules; print({'fmpy', 'numpy', 'rich', 'lxml'} & set(sys.modules))"
    done = subprocess.run(
        [sys.executable, "-c", heavy], capture_output=True, text=True, cwd=ROOT, env=os.environ
    )
    assert done.stdout.strip() == "set()", done.stderr


def test_values_are_the_same_but_for_rounding():
    assert same(0.1 + 0.2, 0.3)
    assert same(float("nan"), float("nan"))
    assert same(0.0, 1e-13)
    assert not same(0.3, 0.3 + 1e-8)
    assert not same(float("nan"), 0.0)
    assert same("a", "a")
    assert not same("a", "b")
    assert same(3, 3)
    assert not same(10**12, 10**12 + 1), "whole numbers have no rounding"
