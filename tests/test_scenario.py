"""Every wrong scenario ends in one message that names the place and the nearest right name."""

import json

import pytest
from support.plain import GAIN
from support.project import ROOT

import cosim
from cosim.errors import InputError
from cosim.formats.imported import Unpacked
from cosim.scenario import json_schema, load_scenario
from cosim.scenario.load import cut_short
from cosim.system import prepare


def refused(content):
    """The message with which a scenario is refused, which must be one line."""
    with pytest.raises(InputError) as error:
        prepare(load_scenario(content))
    assert "\n" not in str(error.value)
    return str(error.value)


def test_published_schema_is_that_of_the_code():
    published = json.loads((ROOT / "docs" / "scenario.schema.json").read_text())
    assert published == json_schema()


@pytest.mark.parametrize("path", sorted((ROOT / "scenarios").glob("*.json")), ids=lambda p: p.stem)
def test_shipped_scenario_is_valid_and_named_like_its_file(path):
    scenario = load_scenario(path)
    assert scenario.name == path.stem
    assert scenario.description


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"stopp": 1.0}, "stopp: unknown key; did you mean 'stop'?"),
        ({"step": 0.0}, "step: Input should be greater than or equal to"),
        ({"step": "fast"}, "step: "),
        ({"stop": 2.005}, "stop = 2.005 s is not a multiple of step = 0.01 s"),
        ({"stop": float("inf")}, "stop: "),
        ({"seed": -1}, "seed: "),
        ({"roles": {"poses": []}}, "roles.poses: unknown key; did you mean 'pose'?"),
        ({"roles": {"pose": ["vessel.x", "vessel.y"]}}, "roles.pose[2]: is missing"),
        ({"roles": {"pose": ["vessel.x", "vessel.y", "vessel.psy"]}}, "roles.pose: 'vessel' has no variable 'psy'; did you mean 'psi'?"),
        ({"roles": {"target": ["guide.x_t", "guidance.y_t", "guidance.psi_t"]}}, "roles.target: no instance 'guide'; did you mean 'guidance'?"),
        ({"algorithm": "newton"}, "'gauss_seidel' or 'jacobi'"),
        ({"name": "a/b"}, "name: cannot be the name of a folder"),
        ({"name": ".."}, "name: cannot be the name of a folder"),
        ({"name": ""}, "name: "),
        ({"fmus": {"a": {"path": "--list"}}}, "fmus.a.path: '--list' is not the name of an .fmu file"),
        ({"fmus": {"a": {"path": "x\0.fmu"}}}, "is not the name of an .fmu file"),
        ({"fmus": {"a": {"path": "x" * 5000 + ".fmu"}}}, "is not the name of an .fmu file"),
        ({"fmus": {"a": {"path": "vessel.fmu", "parameters": {"X_u": 10**400}}}}, "fmus.a.parameters.X_u"),
        ({"fmus": {"a": {"path": "vessel.fmu", "step": 5.0}}}, "longer than the whole run"),
        ({"stop": 1e300, "step": 1e-5}, "stop"),
        ({"fmus": {"my.vessel": {"path": "vessel.fmu"}}}, "'my.vessel' cannot be an instance"),
        ({"fmus": {}}, "fmus: "),
        ({"connections": [["vessel.x_m"]]}, "connections[0]"),
        ({"log": {"every": 0}}, "log.every: "),
        ({"log": {"evry": 1}}, "log.evry: unknown key; did you mean 'every'?"),
        ({"log": {"signals": ["vessel.xx"]}}, "log.signals[0]: 'vessel' has no variable 'xx'"),
        ({"log": {"signals": ["vesel.*"]}}, "log.signals[0]: nothing matches 'vesel.*'"),
        ({"metrics": {"from": 5.0}}, "metrics: there is no time from 5.0 to 2.0 s in a run of 2.0 s"),
        ({"metrics": {"from": 1.0, "to": 0.5}}, "no time from 1.0 to 0.5 s"),
        ({"metrics": {"form": 1.0}}, "metrics.form: unknown key; did you mean 'from'?"),
        (
            {"events": [{"time": 1.0, "model": "vesel", "variable": "X_u", "action": "reset"}]},
            "events[0]: no instance 'vesel'; did you mean 'vessel'?",
        ),
        (
            {"events": [{"time": 1.0, "model": "vessel", "variable": "X_w", "action": "reset"}]},
            "events[0]: 'vessel' has no variable 'X_w'; did you mean",
        ),
        (
            {"events": [{"time": 1.0, "model": "vessel", "variable": "x_0", "action": "override", "value": 1.0}]},
            "vessel.x_0 is a parameter that cannot change during a run",
        ),
        (
            {"events": [{"time": 1.0, "model": "vessel", "variable": "X_u", "action": "override"}]},
            "override needs a 'value'",
        ),
        (
            {"events": [{"time": 1.0, "model": "vessel", "variable": "X_u", "action": "reset", "value": 1}]},
            "reset takes no 'value'",
        ),
        (
            {"events": [{"time": 1.0, "model": "vessel", "variable": "X_u", "action": "hold"}]},
            "is held in any case",
        ),
        (
            {"events": [{"time": 1.0, "model": "vessel", "variable": "m", "action": "override", "value": -1}]},
            "vessel.m = -1 is below its minimum 0.0",
        ),
        (
            {"events": [{"time": 1.0, "model": "vessel", "variable": "X_u", "action": "overide", "value": 1}]},
            "events[0].action: ",
        ),
        (
            {"events": [{"time": 1.0, "model": "thrusters", "variable": "F_bow", "action": "bias", "value": -100.0}]},
            "thrusters.F_bow = -97.371 is below its minimum",
        ),
        (
            {"faults": [{"kind": "bias", "signals": ["vessel.X_u"], "value": 1.0}]},
            "vessel.X_u is a parameter, not an input or output",
        ),
        (
            {"faults": [{"kind": "bias", "signals": ["observer.x_m", "controller.x_t"], "value": 1.0}]},
            "of one instance",
        ),
        (
            {"faults": [{"kind": "bias", "signals": ["observer.x_mm"], "value": 1.0}]},
            "faults[0] (bias): 'observer' has no variable 'x_mm'; did you mean 'x_m'?",
        ),
        (
            {"faults": [{"kind": "noise", "signals": ["observer.x_m", "observer.x_m"], "std": 1.0}]},
            "'signals' has observer.x_m twice",
        ),
        (
            {"faults": [{"kind": "wrap", "signals": ["observer.psi_m", "observer.y_m"]}]},
            "faults[0] (wrap): observer.y_m is in m, and only angles in rad wrap",
        ),
        (
            {"events": [{"time": 2.0, "model": "vessel", "variable": "tau_X", "action": "override", "value": v} for v in (1.0, 2.0)]},
            "events[1]: events[0] has the same action on vessel.tau_X at t = 2 s",
        ),
    ],
)  # fmt: skip
def test_wrong_content_is_refused(ellipse, change, message):
    assert message in refused(ellipse | change)


@pytest.mark.parametrize(("at", "late"), [([99.0, 98.0], True), ([0.5, 99.0], False), ([], False)])
def test_a_fault_after_the_end_has_no_effect_and_says_so(ellipse, at, late):
    fault = {"kind": "freeze", "signals": ["observer.x_m"], "duration": 1.0}
    given = {"at": at} if at else {"rate": 0.1}
    ellipse |= {"stop": 90.0, "faults": [fault | given]}
    found = [w for w in prepare(load_scenario(ellipse)).warnings if "no effect" in w]
    line = "faults[0] (freeze): no step starts at or after t = 98.0 s: no effect"
    assert found == ([line] if late else [])


@pytest.mark.parametrize(
    ("time", "says"),
    [
        (0.004, "faults[0] (delay): 0.004 s is less than half a step, 0.01 s: no effect"),
        (90.0, "faults[0] (delay): 90 s is longer than the run: the first values are held"),
        (0.0, None),
        (0.005, None),
        (89.0, None),
    ],
)
def test_a_delay_of_no_step_or_of_the_whole_run_says_so(ellipse, time, says):
    ellipse |= {"stop": 90.0, "faults": [{"kind": "delay", "signals": ["observer.x_m"], "time": time}]}
    found = [w for w in prepare(load_scenario(ellipse)).warnings if "(delay)" in w]
    assert found == ([says] if says else [])


def test_a_trial_is_conducted_by_what_is_connected(ellipse):
    assert prepare(load_scenario("otter_circle")).trial is not None
    ellipse["fmus"]["extra"] = {"path": "guidance_circle.fmu"}
    assert prepare(load_scenario(ellipse)).trial is None


def test_a_start_value_of_a_connected_input_has_no_effect_and_says_so(ellipse):
    ellipse["fmus"]["vessel"]["parameters"] = {"tau_X": 1000.0, "m": 15.0}
    found = [w for w in prepare(load_scenario(ellipse)).warnings if "no effect" in w]
    assert found == [
        "fmus.vessel: tau_X = 1000.0 has no effect, as the input is connected or has a recording"
    ]


@pytest.mark.parametrize("stop", [1.0, 3.0])
def test_a_recording_that_ends_before_the_run_says_so(ellipse, tmp_path, stop):
    (tmp_path / "force.csv").write_text("time,X\n0,1\n2,3\n")
    recording = {"path": str(tmp_path / "force.csv"), "inputs": {"vessel.tau_X": "X"}}
    ellipse |= {"stop": stop, "recordings": [recording]}
    found = [w for w in prepare(load_scenario(ellipse)).warnings if w.startswith("recordings[0]")]
    assert found == (["recordings[0]: it ends at 2 s; its last values are held"] if stop > 2.0 else [])


@pytest.mark.parametrize(
    ("entry", "message"),
    [
        ({"path": "vesel.fmu"}, "no FMU 'vesel'; did you mean 'vessel'?"),
        ({"path": "nowhere/vessel.fmu"}, "no such FMU: "),
        ({"path": "vessel.fmu", "stepp": 0.01}, "fmus.vessel.stepp: unknown key; did you mean 'step'?"),
        ({"path": "vessel.fmu", "step": 0.015}, "fmus.vessel: step = 0.015 s is not a multiple"),
        (
            {"path": "vessel.fmu", "parameters": {"X_uu_": 1.0}},
            "vessel.X_uu_ does not exist; did you mean",
        ),
        ({"path": "vessel.fmu", "parameters": {"x": 1.0}}, "vessel.x cannot be set"),
        (
            {"path": "vessel.fmu", "parameters": {"m": [1.0]}},
            "fmus.vessel.parameters.m: Input should be a valid number",
        ),
        ({"path": "vessel.fmu", "parameters": {"m": -1.0}}, "vessel.m = -1.0 is below its minimum 0.0"),
        ({"path": "vessel.fmu", "parameters": {"m": "heavy"}}, "needs a value of type Real"),
        ({"path": "vessel.fmu", "parameters": {"m": True}}, "needs a value of type Real"),
        ({}, "fmus.vessel.path: is missing"),
    ],
)
def test_wrong_fmu_entry_is_refused(ellipse, entry, message):
    ellipse["fmus"]["vessel"] = entry
    assert message in refused(ellipse)


@pytest.mark.parametrize(
    ("connection", "message"),
    [
        (
            ["vesel.x", "observer.x_m"],
            "connections[0] vesel.x -> observer.x_m: no instance 'vesel'; did you",
        ),
        (["vessel.x_mm", "observer.x_m"], "'vessel' has no variable 'x_mm'; did you mean 'x_m'?"),
        (["vessel.x", "observer.xm"], "'observer' has no variable 'xm'; did you mean 'x_m'?"),
        (["vessel.X_u", "observer.x_m"], "vessel.X_u is a parameter, not an output"),
        (["vessel.x", "observer.x_hat"], "observer.x_hat is an output, not an input"),
        (["vessel.x", "observer.y_m"], "observer.y_m is already connected to vessel.x"),
        (
            ["vessel.u", "observer.x_m"],
            "vessel.u -> observer.x_m: unit 'm/s' cannot be converted to 'm'",
        ),
        (["vessel.*", "observer.x_m"], "exactly one * on each side"),
        (["vessel.*", "vesel.*"], "no instance 'vesel'"),
        (["vessel.*", "guidance.*"], "no output and input agree"),
        (["vessel", "observer.x_m"], "'vessel' has no variable ''"),
    ],
)
def test_wrong_connection_is_refused_with_both_ends(ellipse, connection, message):
    ellipse["connections"] = [
        connection,
        *([["vessel.y", "observer.y_m"]] if "already" in message else []),
    ]
    text = refused(ellipse)
    assert "connections[" in text
    assert message in text


def test_optional_connection_is_made_where_both_ends_are_there(ellipse):
    poses = ["vessel.*", "observer.*"]
    wanted = {(c.source.name, c.target.name) for c in prepare(load_scenario(ellipse)).connections}
    assert ("thrusters.tau_cmd_X", "controller.tau_cmd_X") in wanted, "as it is shipped"
    tau = ellipse["optional_connections"]
    ellipse["connections"].remove(poses)
    for optional in (
        [poses],
        [poses, ["vessel.x", "observer.x_m"]],  # x_m is connected already
        [["vessel.x_m", "observer.x_m"], poses],
        [poses, ["vessel.x_mm", "observer.x_m"], ["vessel.x_*", "observer.q_*"]],  # not there
    ):
        ellipse["optional_connections"] = [*optional, *tau]
        made = [(c.source.name, c.target.name) for c in prepare(load_scenario(ellipse)).connections]
        assert len(made) == len(wanted)
        assert set(made) == wanted


def test_optional_connection_that_cannot_be_is_told(ellipse):
    ellipse["optional_connections"] = [["vessel.x", "autopilot.x"]]
    assert any("no instance 'autopilot'" in w for w in prepare(load_scenario(ellipse)).warnings)
    ellipse["connections"].remove(["vessel.*", "observer.*"])
    ellipse["optional_connections"] = [["vessel.u", "observer.x_m"]]
    assert "optional_connections[0] vessel.u -> observer.x_m: unit 'm/s'" in refused(ellipse)


def test_unconnected_input_is_a_warning(ellipse):
    ellipse["connections"].pop(0)
    ellipse["faults"] = []
    (warning,) = prepare(load_scenario(ellipse)).warnings
    assert warning == "observer: input x_m, y_m, psi_m not connected; keeps its start value"


def test_input_given_a_start_value_is_meant_to_stay_free(ellipse):
    ellipse["connections"].pop(0)
    ellipse["faults"] = []
    ellipse["fmus"]["observer"]["parameters"] = {"x_m": 5.0, "y_m": 2.0, "psi_m": 0.1}
    assert prepare(load_scenario(ellipse)).warnings == []


def test_fault_on_an_unconnected_input_is_refused(ellipse):
    ellipse["connections"].pop(0)
    assert "observer.x_m is not connected" in refused(ellipse)


def test_group_connects_all_that_agree(ellipse):
    system = prepare(load_scenario(ellipse))
    pairs = {c.target.name: c.source.name for c in system.connections}
    assert pairs["observer.tau_N"] == "thrusters.tau_cmd_N"
    assert pairs["vessel.tau_X"] == "thrusters.tau_act_X"
    assert pairs["controller.psi_t_ddot"] == "guidance.psi_t_ddot"
    assert pairs["controller.frozen"] == "observer.frozen"
    assert {pairs[f"thrusters.{c}"] for c in ("u_c", "v_c")} == {"vessel.u_c", "vessel.v_c"}
    assert len(pairs) == 3 + 3 + 10 + 9 + 3 + 3 + 3 + 3 + 2  # the last ones are optional


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("no.json", None, "no such scenario"),
        ("bad.json", "{", "is not JSON"),
        ("list.json", "[]", "the content: "),
        ("twice.json", '{"name": "a", "step": 1, "step": 2}', "the key 'step' occurs twice"),
        ("deep.json", "[" * 100000, "cannot be read"),
        ("digits.json", '{"stop": 1' + "0" * 5000 + "}", "cannot be read"),
        ("surrogate.json", '{"name": "a", "description": "\\ud800"}', "cannot be read"),
        ("nan.json", '{"name": "a", "step": NaN, "stop": 1, "fmus": {"a": {"path": "b"}}}', "step: "),
        ("folder/", None, "no such scenario"),
        ("latin.json", b"\xff\xfe{}", "cannot be read"),
    ],
)
def test_unreadable_file_is_refused(tmp_path, name, content, message):
    path = tmp_path / name
    if content is not None:
        path.write_bytes(content if isinstance(content, bytes) else content.encode())
    assert message in refused(path)


def test_missing_scenario_suggests_the_nearest_file(tmp_path):
    (tmp_path / "ellipse.json").write_text("{}")
    assert "did you mean 'ellipse.json'?" in refused(tmp_path / "elipse.json")


def test_shipped_scenario_comes_before_a_file_of_another_kind(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "ellipse.csv.json").write_text("{}")
    assert "did you mean 'ellipse'?" in refused("elipse")


def one_fmu(path, **entry):
    return {"name": "one", "step": 0.1, "stop": 1.0, "fmus": {"a": {"path": str(path), **entry}}}


def test_what_is_no_fmu_is_refused(tmp_path, plain_fmu):
    text = tmp_path / "text.fmu"
    text.write_text("not a zip")
    assert "not a zip archive" in refused(one_fmu(text))
    empty = tmp_path / "empty.fmu"
    empty.write_bytes(b"PK\x05\x06" + bytes(18))
    assert "no modelDescription.xml" in refused(one_fmu(empty))
    fmi3 = plain_fmu("Fmi3", GAIN, edits=[('fmiVersion="2.0"', 'fmiVersion="3.0"')])
    assert "3.0" in refused(one_fmu(fmi3))
    garbage = plain_fmu("Garbage", GAIN, edits=[("</fmiModelDescription>", "")])
    assert "cannot be read as an FMU" in refused(one_fmu(garbage))


def test_model_exchange_only_is_refused(plain_fmu):
    me = plain_fmu("OnlyMe", GAIN, edits=[("<CoSimulation", "<ModelExchange"),
                                          (' canHandleVariableCommunicationStepSize="true"', ""),
                                          (' canInterpolateInputs="false"', "")])  # fmt: skip
    assert "model exchange only" in refused(one_fmu(me))


def test_types_are_checked(plain_fmu):
    whole = """
        self.n = 0
        self.flag = False
        self.text = "a"
        self.register_variable(Integer("n", causality=Fmi2Causality.input))
        self.register_variable(Boolean("flag", causality=Fmi2Causality.input))
        self.register_variable(String("text", causality=Fmi2Causality.parameter,
                                      variability=Fmi2Variability.fixed))
    """
    a, b = plain_fmu("RealOut", GAIN), plain_fmu("WholeIn", whole)
    content = {
        "name": "types", "step": 0.1, "stop": 1.0,
        "fmus": {"a": {"path": str(a)}, "b": {"path": str(b)}},
        "connections": [["a.y", "b.n"]],
    }  # fmt: skip
    assert "Real cannot feed Integer" in refused(content)
    content["connections"] = [["a.y", "b.flag"]]
    assert "Real cannot feed Boolean" in refused(content)
    content["connections"] = []
    content["fmus"]["b"]["parameters"] = {"text": 3}
    assert "needs a value of type String" in refused(content)
    content["fmus"]["b"]["parameters"] = {"n": 1.5}
    assert "needs a value of type Integer" in refused(content)


def test_once_per_process_is_respected(plain_fmu):
    once = plain_fmu(
        "Once", GAIN,
        edits=[('canBeInstantiatedOnlyOncePerProcess="false"', 'canBeInstantiatedOnlyOncePerProcess="true"')],
    )  # fmt: skip
    content = one_fmu(once)
    content["fmus"]["b"] = {"path": str(once)}
    assert "only once per process" in refused(content)


def test_own_name_wins_over_a_file_beside_and_other_files_are_found(ellipse, tmp_path, plain_fmu):
    other = plain_fmu("Other", GAIN)
    (tmp_path / "vessel.fmu").write_bytes(other.read_bytes())
    ellipse["fmus"]["extra"] = {"path": "Other.fmu"}
    path = tmp_path / "scenario.json"
    path.write_text(json.dumps(ellipse))
    system = prepare(load_scenario(path))
    assert system.models["vessel"].name == "vessel"
    assert system.models["extra"].name == "Other"
    assert "'./vessel.fmu' names that file" in system.warnings[0]
    ellipse["fmus"]["vessel"] = {"path": "./Other.fmu"}
    ellipse["connections"] = ellipse["events"] = ellipse["faults"] = []
    path.write_text(json.dumps(ellipse))
    assert prepare(load_scenario(path)).models["vessel"].name == "Other"


def test_public_names_are_there():
    for name in cosim.__all__:
        assert getattr(cosim, name) is not None
    with pytest.raises(AttributeError):
        _ = cosim.nothing


def test_metrics_of_a_run_that_is_cut_short_are_from_its_start(ellipse, tmp_path):
    scenario = load_scenario(ellipse | {"stop": 2.0, "metrics": {"from": 5.0}})
    scenario.set_origin(tmp_path, ["read elsewhere"], Unpacked())
    changed = cut_short(scenario)
    assert changed.metrics.start == 0.0
    assert changed.notes == [
        "read elsewhere",
        "the window of the metrics begins at 5 s, after the end of the run: metrics are from 0 s on",
    ]
    assert changed.folder == tmp_path
    assert changed.unpacked is scenario.unpacked, "whose files would go with the last reference"


@pytest.mark.parametrize(
    ("window", "short"),
    [({}, False), ({"from": 1.0}, False), ({"from": 2.0}, True), ({"from": 2.0, "to": 3.0}, True)],
)
def test_a_run_is_cut_short_that_ends_where_its_window_begins(ellipse, window, short):
    scenario = load_scenario(ellipse | {"stop": 2.0, "metrics": window})
    assert (cut_short(scenario) is scenario) == (not short)


def test_a_hidden_file_is_not_proposed_as_a_scenario(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / ".settings.json").touch()
    with pytest.raises(InputError, match="there are ") as error:  # those that are shipped
        cosim.load_scenario("qqq")
    assert ".settings" not in str(error.value)


def test_an_empty_file_is_called_so(tmp_path):
    (tmp_path / "s.json").write_text(" \n")
    with pytest.raises(InputError, match=r"cannot be read as a scenario: it is empty$"):
        load_scenario(tmp_path / "s.json")


def test_one_more_fault_is_one(ellipse):
    assert refused(ellipse | {"stop": "x", "step": "y"}).endswith("(and 1 more error)")
    noise = {"kind": "noise", "signals": ["observer.x_m"], "std": -1.0}  # a number, or a list of them
    assert "more error" not in refused(ellipse | {"faults": [noise]})


def test_folders_in_place_of_files_are_named_as_such(tmp_path):
    with pytest.raises(InputError, match="is a folder; a map is a file"):
        cosim.scenario.json_content(tmp_path, "a map")
    with pytest.raises(InputError, match="is a folder; a parameter set is a file"):
        list(cosim.scenario.find_parameters([tmp_path]))


def test_a_value_that_is_no_number_needs_a_finite_one(ellipse):
    ellipse["fmus"]["vessel"]["parameters"] = {"x_0": float("nan")}
    assert "finite number; got nan" in refused(ellipse)
