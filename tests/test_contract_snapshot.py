"""A system as data for a page, from a master of which only the tables are there; and logs that were cut off."""

import struct
from base64 import b64decode
from types import SimpleNamespace

import numpy as np
import pytest

from cosim import InputError
from cosim.live import alternatives, snapshot
from cosim.live.snapshot import packed
from cosim.master.changes import Changes
from cosim.results import log
from cosim.scenario.operations import Add, Replace
from cosim.scenario.schema import Event


def numbers(text):
    raw = b64decode(text)
    return [*struct.unpack(f"<{len(raw) // 8}d", raw)]


def variable(name, causality="output", reference=0, variability="continuous", start=0.0, unit=None):
    return SimpleNamespace(
        name=name, causality=causality, reference=reference, variability=variability, start=start, min=-1.0, max=2.0,
        unit=None if unit is None else SimpleNamespace(name=unit), description=f"the {name}",
    )  # fmt: skip


def signal(instance, v):
    return SimpleNamespace(instance=instance, variable=v, name=f"{instance}.{v.name}")


VESSEL = [
    variable("x", reference=5),
    variable("tau_X", "input", 3),
    variable("m", "parameter", 1, "fixed", 9.0),
]
DRIVE = [
    variable("n", "input", 2, unit="1/s"), variable("tau_X", reference=7), variable("power", reference=8),
    variable("asked", "input", 4), variable("lag", "parameter", 1, "tunable", 0.5, "s"),
]  # fmt: skip
OBSERVER = [variable("x_m", "input", 1), variable("x_hat", reference=2)]
EVERY = {"vessel": VESSEL, "drive": DRIVE, "observer": OBSERVER}


def link(source, target):
    def end(name):
        instance, _, own = name.partition(".")
        return signal(instance, next(v for v in EVERY[instance] if v.name == own))

    return SimpleNamespace(source=end(source), target=end(target))


LINKS = [
    link("vessel.x", "observer.x_m"),
    link("drive.tau_X", "vessel.tau_X"),
    link("observer.x_hat", "drive.n"),
]


def event(time, name, action="override", value=3.0):
    model, _, own = name.partition(".")
    return Event(time=time, model=model, variable=own, action=action, value=value)


class Roles(SimpleNamespace):
    pose, velocity, target = (
        ("vessel.x", "vessel.y", "vessel.psi"),
        ("vessel.u",) * 3,
        ("guidance.x",) * 3,
    )
    force, requested_force, power = (
        ("drive.tau_X",),
        ("controller.tau_X",),
        ("drive.power", "drive.other"),
    )


def system(events=(), force=("drive.tau_X",)):
    signals = {
        s.name: s
        for n, vs in EVERY.items()
        for v in vs
        if v.causality != "parameter"
        for s in [signal(n, v)]
    }
    models = {
        n: SimpleNamespace(name=f"{n}_fmu", variables={v.name: v for v in vs}) for n, vs in EVERY.items()
    }
    roles = Roles()
    roles.force = force
    scenario = SimpleNamespace(
        name="s", description="d", seed=3, step=0.1, roles=roles, events=[*events], log=SimpleNamespace(every=2),
        metrics=SimpleNamespace(start=1.0, stop=None),
    )  # fmt: skip

    def find(name, where):
        instance, _, own = name.partition(".")
        return signal(instance, models[instance].variables[own])

    parameters = {n: [] for n in EVERY} | {"drive": [(DRIVE[4], 0.7)]}
    return SimpleNamespace(
        scenario=scenario, steps=3, signals=signals, models=models, order=["vessel", "drive", "observer"],
        connections=LINKS, logged=["vessel.x", "drive.n"], outline=None, parameters=parameters, find=find,
    )  # fmt: skip


class Instance:
    def __init__(self, name, model):
        self.name, self.model = name, model

    def get_value(self, v):
        return 10.0 * v.reference + len(self.name)


def master(of=None, operation=None, jacobi=True):
    of = of or system()
    names = [*of.signals]
    slots = {n: k for k, n in enumerate(names)}
    table = SimpleNamespace(
        slots=slots, signals=[of.signals[n] for n in names], values=[0.5 * k for k in range(len(names))]
    )
    steppers = []
    for name in of.order:
        own = [s for s in table.signals if s.instance == name]
        values = memoryview(np.zeros(len(names)))
        effects = [operation] if operation is not None and name == "drive" else []
        changes = Changes(values, effects)
        steppers.append(
            SimpleNamespace(
                instance=Instance(name, of.models[name]),
                every=2 if name == "observer" else 1,
                step_size=0.1,
                put=[s for s in own if s.variable.causality == "input"],
                got=[s for s in own if s.variable.causality == "output"],
                copies=[
                    (slots[c.target.name], slots[c.source.name], 1)
                    for c in LINKS
                    if c.target.instance == name
                ],
                input_effects=effects,
                output_effects=[],
                input_changes=changes,
                output_changes=Changes(values, []),
            )
        )
    return SimpleNamespace(system=of, table=table, steppers=steppers, is_jacobi=jacobi)


def test_numbers_are_packed_to_the_bit():
    values = [0.1, -0.0, 1e300, np.inf, 5e-324]
    assert b64decode(packed(values)) == struct.pack("<5d", *values)


def test_a_page_has_the_signals_and_their_values():
    m = master()
    stated = snapshot.snapshot(m)
    slots = m.table.slots
    assert stated["signals"] == [*slots]
    assert numbers(stated["row"]) == m.table.values
    assert stated["logged"] == [slots["vessel.x"], slots["drive.n"]]
    assert stated["roles"]["pose"] == [slots["vessel.x"], -1, -1]
    assert stated["roles"]["force"] == [slots["drive.tau_X"]]
    assert stated["power"] == [slots["drive.power"]]
    assert (stated["step"], stated["steps"], stated["jacobi"], stated["every"]) == (0.1, 3, True, 2)
    assert (stated["from"], stated["to"], stated["outline"]) == (1.0, None, None)
    # Where the force after limits is not there, what the controller asks for.
    asked = master(system(force=("drive.other",)))
    asked.system.scenario.roles.requested_force = ("drive.tau_X",)
    assert snapshot.snapshot(asked)["roles"]["force"] == [slots["drive.tau_X"]]
    shaped = system()
    shaped.outline = SimpleNamespace(_asdict=lambda: {"length": 1.0})
    assert snapshot.snapshot(master(shaped))["outline"] == {"length": 1.0}


def test_an_fmu_has_its_start_values_ports_and_what_may_be_changed():
    m = master()
    vessel, drive, observer = snapshot.snapshot(m)["fmus"]
    slots = m.table.slots
    assert (drive["name"], drive["module"], drive["h"], observer["every"]) == (
        "drive",
        "drive_fmu",
        0.1,
        2,
    )
    # Parameters and inputs by their references: lag 1, n 2, asked 4.
    assert numbers(drive["values"]) == [15.0, 25.0, 45.0]
    assert drive["put"] == [[2, slots["drive.n"]], [4, slots["drive.asked"]]]
    assert drive["got"] == [[7, slots["drive.tau_X"]], [8, slots["drive.power"]]]
    assert drive["copies"] == [(slots["drive.n"], slots["observer.x_hat"], 1)]
    (lag,) = drive["parameters"]
    assert lag == {
        "reference": 1,
        "name": "lag",
        "unit": "s",
        "description": "the lag",
        "min": -1.0,
        "max": 2.0,
    }
    assert vessel["parameters"] == [], "its mass cannot change"
    assert vessel["on_inputs"] == vessel["on_outputs"] == []


@pytest.mark.parametrize("jacobi", [True, False])
def test_an_operation_is_planned_to_the_end_of_the_run(jacobi):
    asked = []

    def plan(t):
        asked.append(round(t, 9))
        return [10.0 * t] if t > 0.15 else None

    stated = snapshot.snapshot(master(operation=Add([4], plan), jacobi=jacobi))
    (planned,) = stated["fmus"][1]["on_inputs"]
    times = [0.0, 0.1, 0.2] if jacobi else [0.1, 0.2, 0.3]
    assert asked == times
    assert [*b64decode(planned["acts"])] == [t > 0.15 for t in times]
    acting = [t for t in times if t > 0.15]
    assert [x for x in numbers(planned["numbers"]) if x] == pytest.approx([10.0 * t for t in acting])
    assert (planned["slots"], planned["stride"], planned["code"]) == ([4], 1, Add.code)
    always = snapshot.snapshot(master(operation=Replace([2, 3], [1.5, 2.5])))["fmus"][1]["on_inputs"][0]
    assert (always["acts"], always["stride"], always["calls"]) == (None, 0, 0)
    assert numbers(always["numbers"]) == [1.5, 2.5]


def test_a_fault_that_is_a_function_cannot_be_run_by_a_page():
    with pytest.raises(InputError, match=r"is a Python function, .*; a page cannot run it"):
        snapshot.snapshot(master(operation=lambda values, t: None))


def test_events_are_in_order_and_those_at_the_start_have_been():
    events = [
        event(2.0, "drive.lag", value=0.9), event(0.0, "drive.n"), event(1.0, "drive.n", "bias", -2.0),
        event(3.0, "vessel.x", "hold", None),
    ]  # fmt: skip
    m = master(system(events))
    first, second, third = snapshot.snapshot(m)["events"]
    slots = m.table.slots
    assert first == {
        "time": 1.0, "fmu": 1, "kind": "input", "place": slots["drive.n"], "action": "bias", "value": -2.0,
        "original": 0.0,
    }  # fmt: skip
    assert (second["place"], second["kind"], second["value"], second["original"]) == (
        1,
        "parameter",
        0.9,
        0.7,
    )
    assert (third["fmu"], third["place"], third["value"]) == (0, slots["vessel.x"], 0.0)


def test_measured_poses_and_actuators_are_found():
    m = master()
    stated = snapshot.snapshot(m)
    slots = m.table.slots
    assert stated["measured"] == [slots["observer.x_m"]]
    shown = {a["name"]: a for a in stated["actuators"]}
    assert [*shown] == ["n", "power"], "neither a force, nor what nobody commands"
    assert shown["n"] == {
        "reference": 2, "name": "n", "unit": "1/s", "description": "the n", "min": -1.0, "max": 2.0,
        "slot": slots["drive.n"],
    }  # fmt: skip
    other = system()
    other.signals = {n: s for n, s in other.signals.items() if n != "observer.x_m"}
    assert snapshot._measured(other) == ["observer.x_m"], "what the pose is connected to"


# Other FMUs in place of one


def test_other_fmus_of_a_kind_are_offered_where_they_fit(monkeypatch):
    of = system([event(1.0, "drive.n")])
    of.models["observer"].name = "observer_mdf"
    asked = []

    def run_builder(*words):
        asked.append(words)
        if words[0] == "--list":
            return [
                "observer_mdf  one",
                "observer_kalman  two",
                "observer_df  three",
                "controller_abs  four",
            ]
        return [f"{name}.fmu" for name in words[words.index("--") + 1 :]]

    monkeypatch.setattr(
        alternatives, "builder_options", lambda scenario, native: ["--native"] if native else ["-o"]
    )
    monkeypatch.setattr(alternatives, "run_builder", run_builder)
    monkeypatch.setattr(
        alternatives, "_fitting", lambda s, name, paths, *_: iter(paths if name == "observer" else [])
    )
    found = alternatives.alternatives(of, {}, None)
    assert found == [{"fmu": 2, "options": ["observer_kalman.fmu", "observer_df.fmu"]}]
    assert ("-o", "--", "observer_kalman", "observer_df") in asked
    assert all("drive" not in " ".join(words) for words in asked), "its input is changed by an event"


def test_an_fmu_fits_that_leaves_all_other_connections(monkeypatch):
    of = system()
    entry = SimpleNamespace(parameters={"a": 1.0, "b": 2.0})
    entry.model_copy = lambda update: SimpleNamespace(**update)
    of.scenario.fmus = {"observer": entry}
    of.scenario.model_copy = lambda update: SimpleNamespace(**update)
    tried = []

    class Folder:
        def __truediv__(self, name):
            return name

    of.scenario.folder = Folder()

    def prepare(scenario, overrides, models):
        tried.append(scenario.fmus["observer"])
        name = scenario.fmus["observer"].path
        if name == "bad":
            raise InputError("it does not fit")
        links = LINKS if name == "good" else LINKS[:2]
        return SimpleNamespace(connections=links, label=name)

    def model(path):
        return SimpleNamespace(path=SimpleNamespace(name=path), variables={"a": None})

    monkeypatch.setattr(alternatives, "FmuModel", model)
    monkeypatch.setattr(alternatives, "prepare", prepare)
    monkeypatch.setattr(alternatives, "_option", lambda other, instance, slots: other.label)
    found = [*alternatives._fitting(of, "observer", ["bad", "good", "less"], {}, None)]
    assert found == ["good"]
    assert tried[0].parameters == {"a": 1.0}


def test_inputs_beyond_the_table_get_places_behind_it():
    of = system()
    slots = {"vessel.x": 0, "observer.x_m": 1, "observer.x_hat": 2}
    more = variable("y_m", "input", 9, start=None)
    of.models["observer"].variables["y_m"] = more
    of.models["observer"].variables["K"] = variable("K", "parameter", 0, start=4.0)
    of.parameters["observer"] = [(of.models["observer"].variables["K"], 6.0)]
    of.connections = [
        LINKS[0],
        SimpleNamespace(source=LINKS[0].source, target=signal("observer", more)),
        LINKS[1],
    ]
    stated = alternatives._option(of, "observer", slots)
    assert numbers(stated["values"]) == [6.0, 0.0, 0.0]
    assert stated["copies"] == [[1, 0, 1], [3, 0, 1]]
    assert stated["put"] == [[1, 1], [9, 3]]
    assert stated["got"] == [[2, 2]]
    assert slots == {"vessel.x": 0, "observer.x_m": 1, "observer.x_hat": 2}
    assert alternatives._connections_elsewhere(of, "observer") == {("drive.tau_X", "vessel.tau_X")}


# Logs


@pytest.mark.parametrize(
    ("text", "rows", "kept"),
    [
        ("time,x\n1,2\n3,4\n", 2, None),
        ("time,x\n1,2\n3,", 1, "time,x\n1,2\n"),
        ("time", 0, ""),
        ("", 0, None),
    ],
)
@pytest.mark.parametrize("chunk", [2**20, 3])
def test_a_log_that_was_cut_off_is_cut_to_whole_rows(monkeypatch, tmp_path, text, rows, kept, chunk):
    monkeypatch.setattr(log, "CHUNK", chunk)
    file = tmp_path / "log.csv"
    file.write_text(text)
    assert log.cut_to_rows(file) == rows
    assert file.read_text() == (text if kept is None else kept)
    assert log.cut_to_rows(tmp_path / "none.csv") == 0


def test_a_log_in_parquet_has_the_same_numbers(tmp_path):
    pytest.importorskip("pyarrow")
    (tmp_path / "log.csv").write_text("time,a.x,n\n0.1,0.30000000000000004,1\n0.2,-1e-300,2\n")
    before = log.read_log(tmp_path)
    path = log.to_parquet(tmp_path)
    assert [p.name for p in tmp_path.iterdir()] == [path.name] == ["log.parquet"]
    after = log.read_log(tmp_path)
    assert {n: x.tolist() for n, x in after.items()} == {n: x.tolist() for n, x in before.items()}
    assert [*log.read_log(tmp_path, ["n"])] == ["time", "n"]
    with pytest.raises(InputError, match="has no column 'a'"):
        log.read_log(tmp_path, ["a"])
    path.write_bytes(b"PAR1")
    with pytest.raises(InputError, match="cannot be read as a log"):
        log.read_log(tmp_path)


def test_a_terminal_shows_the_first_columns_of_a_log():
    columns = log.LogColumns({f"c{k}": np.zeros(3) for k in range(7)})
    assert repr(columns) == "<log of 3 rows: c0, c1, c2, c3, c4, c5, ...>"
    del columns["c6"]
    assert repr(columns) == "<log of 3 rows: c0, c1, c2, c3, c4, c5>"
    assert repr(log.LogColumns()) == "<log of 0 rows: >"
