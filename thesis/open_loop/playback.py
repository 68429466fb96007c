"""A run played to the FMUs of an observer and a controller by the master, open loop.

Pose, target and the force that acted come from the run. Where the force or the target was lost, they
come from the thrusters' and the guidance's FMU: while all before is the same, these give what was lost.
"""

import csv
import importlib
import json
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

import cosim
from cosim.process import scratch_folder
from diagnosis.execution import Advance, silent
from fmus.declare import Component, variables
from fmus.ship import ship

from .run_source import COMMAND, TARGET, Source

Entry = dict[str, Any]  # of an FMU in a scenario
POSE = ("x_m", "y_m", "psi_m")


@dataclass(frozen=True)
class OpenLoop:
    """The FMUs that a run is played to: entries of a scenario.

    Attributes:
        controller, observer: FMUs.
        thrusters: gives the force where the run has lost it; None: a lost force keeps its last value.
        guidance: where the run has no target, or has lost some of it.
        stated: whether the controller gets the force that acted.
        own: whether observer and controller are those of the run.
    """

    controller: Entry
    observer: Entry
    thrusters: Entry | None = None
    guidance: Entry | None = None
    stated: bool = True
    own: bool = False


@dataclass(frozen=True, eq=False)
class Played:
    """What the FMUs made of a run.

    Attributes:
        source: the run.
        loop: the FMUs.
        log: as of any simulation, name -> (rows,).
        notes: a line each.
    """

    source: Source
    loop: OpenLoop
    log: dict[str, np.ndarray]
    notes: list[str]

    def at_samples(self, name: str) -> np.ndarray:
        """A signal at the rows of the run."""
        rows = np.searchsorted(self.log["time"], self.source.time + 1e-9, side="right") - 1
        return self.log[name][np.clip(rows, 0, None)]


def loop_of(run: Path, controller: str, observer: str | None, scenario: Path | None) -> OpenLoop:
    """The FMUs to play a run to.

    Args:
        run: where the scenario is looked for that made it, if it is a log of this project. Of that are
            taken observer, guidance, what the allocation believes, and the parameters of a controller of
            that name; never the plant.
        controller: ``cl_win_eps``, ``controller_cl_win_eps``, or a path that ends with ``.fmu``.
        observer: the same of an observer; by default the scenario's, or ``mdf``.
        scenario: to take these from in place of the run's own.

    Raises:
        InputError: no such scenario.
    """
    content = _content_of(run) if scenario is None else None
    if scenario is not None:
        content = cosim.load_scenario(scenario).model_dump(mode="json", by_alias=True)
    fmus = {} if content is None else content["fmus"]
    taken = {name: _entry(fmus[name], scenario) for name in ("observer", "guidance") if name in fmus}
    wanted = _path(controller, "controller")
    given = fmus.get("controller", {})
    own = given.get("path") == wanted
    law = _entry(given, scenario) if own else {"path": wanted}
    eyes = taken.get("observer", {"path": "observer_mdf.fmu"})
    if observer is not None and _path(observer, "observer") != eyes["path"]:
        eyes, own = {"path": _path(observer, "observer")}, False
    believed = {
        k: x
        for k, x in fmus.get("thrusters", {}).get("parameters", {}).items()
        if k in ship().allocation_parameters
    }
    wired = [] if content is None else [target for _, target in content["connections"]]
    stated = not own or any(target.startswith("controller.tau_cmd") for target in wired)
    thrusters = {"path": "thrusters.fmu", "parameters": believed}
    return OpenLoop(law, eyes, thrusters, taken.get("guidance"), stated, own and scenario is None)


def watch_loop(run: Path, watch: str, observer: str | None, scenario: Path | None) -> OpenLoop:
    """The observer as of :func:`loop_of`, and a detector in the controller's place."""
    found = loop_of(run, watch, observer, scenario)
    return replace(found, guidance=None, thrusters=None, stated=True)


def _content_of(run: Path) -> dict[str, Any] | None:
    """The scenario of a log of this project."""
    sidecar = (run if run.is_dir() else run.parent) / "log.json"
    if not sidecar.is_file() or not (run.is_dir() or run.name.startswith("log.")):
        return None
    try:
        return json.loads(sidecar.read_text(encoding="utf-8"))["scenario"]
    except (OSError, ValueError, KeyError, TypeError):
        return None  # a log that was cut off has its columns all the same


def _entry(given: Entry, scenario: Path | None) -> Entry:
    """An entry whose file is found from anywhere."""
    kept = {k: given[k] for k in ("path", "parameters") if k in given}
    if Path(kept["path"]).name != kept["path"] and scenario is not None:
        kept["path"] = str((scenario.parent / kept["path"]).resolve())
    return kept


def _path(name: str, kind: str) -> str:
    """The file that a name means: a bare one is an FMU of this project."""
    if Path(name).name != name:
        return str(Path(name).resolve())
    stem = name.removesuffix(".fmu")
    whole = (
        stem if name.endswith(".fmu") or stem.startswith((f"{kind}_", "watch_")) else f"{kind}_{stem}"
    )
    return f"{whole}.fmu"


def play(source: Source, loop: OpenLoop, advance: Advance = silent) -> Played:
    """Feed a run to the FMUs.

    Args:
        source: the run.
        loop: the FMUs.
        advance: progress callback.

    Raises:
        InputError: an FMU does not exist, has no such inputs, or fails.
    """
    notes = [f"samples are not regular: steps of {source.step} s"] if not _regular(source) else []
    loop = replace(loop, observer=_paced(loop, source))
    with scratch_folder() as folder:
        recording = folder / "recording.csv"
        columns = fed(source, loop)
        _write(recording, source.time, columns)
        content = _scenario(source, loop, str(recording), columns, notes)
        advance(f"replay of {source.name}")
        result = cosim.simulate(cosim.load_scenario(content), folder / "out")
        if result.status == "interrupted":
            raise KeyboardInterrupt
        if result.status != "done":
            raise cosim.InputError(f"the replay of run '{source.name}' failed: {result.message}")
        return Played(source, loop, cosim.read_log(result.folder), notes)


def _regular(source: Source) -> bool:
    return bool(np.allclose(np.diff(source.time), source.step, rtol=0.0, atol=1e-9))


def _paced(loop: OpenLoop, source: Source) -> Entry:
    """The observer, which gets how often there is a new measurement, if nobody has."""
    kind, _, name = loop.observer["path"].removesuffix(".fmu").partition("_")
    if "parameters" in loop.observer or kind != "observer":
        return loop.observer
    try:
        component = importlib.import_module(f"fmus.observer.{name}").COMPONENT
    except ImportError:
        return loop.observer
    assert isinstance(component, Component)
    if "measurement_period" not in [v.name for v in variables(component.params)]:
        return loop.observer
    period = round(max(source.track.period, source.step), 9)
    return {**loop.observer, "parameters": {"measurement_period": period}}


def _held(values: np.ndarray) -> np.ndarray:
    """Values (n, m) that keep the last one where one is lost; before the first it is zero."""
    return pd.DataFrame(values).ffill().fillna(0.0).to_numpy()


def fed(source: Source, loop: OpenLoop) -> dict[str, np.ndarray]:
    """What is fed, by the input's name; the force is that of the step before each row."""
    tau = source.tau if loop.thrusters is not None else _held(source.tau)
    before = np.vstack([tau[:1], tau[:-1]])
    pose = source.track.run.pose
    found = {f"observer.{name}": pose[:, k] for k, name in enumerate(POSE)}
    for k, name in enumerate(COMMAND):
        found[name] = before[:, k]
    if source.target is not None:
        target = source.target if loop.guidance is not None else _held(source.target)
        found |= {f"controller.{name}": target[:, k] for k, name in enumerate(TARGET)}
    return found


def _write(path: Path, time: np.ndarray, columns: dict[str, np.ndarray]) -> None:
    """The recording; a pose that is lost is NaN, anything else that is lost an empty cell."""
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(["time", *columns])
        cells = [time.tolist()]
        for name, values in columns.items():
            empty = float("nan") if name.startswith("observer.") else ""
            cells.append([x if np.isfinite(x) else empty for x in values.tolist()])
        writer.writerows(zip(*cells, strict=True))


def _scenario(
    source: Source, loop: OpenLoop, recording: str, columns: dict[str, np.ndarray], notes: list[str]
) -> dict[str, Any]:
    fmus = {"observer": loop.observer, "controller": loop.controller}
    connections = [["observer.*", "controller.*"]]
    if loop.thrusters is not None:
        fmus["thrusters"] = loop.thrusters
        connections += [
            ["controller.tau_*", "thrusters.tau_*"],
            ["thrusters.tau_cmd_*", "observer.tau_*"],
        ]
        if loop.stated:
            connections.append(["thrusters.tau_cmd_*", "controller.tau_cmd_*"])
    inputs = {n: n for n in columns if "." in n}
    inputs |= {f"observer.{n.replace('_cmd', '')}": n for n in COMMAND}
    if loop.stated:
        inputs |= {f"controller.{n}": n for n in COMMAND}
    gaps = source.target is not None and not np.isfinite(source.target).all()
    if loop.guidance is not None and (source.target is None or gaps):
        fmus["guidance"] = loop.guidance
        connections.append(["guidance.*", "controller.*"])
    elif source.target is None and loop.thrusters is not None:
        notes.append(
            "the run has no target, and no --scenario gives one: errors are zero, and the "
            "requested force has no meaning; learning by ε needs neither"
        )
        connections += [[f"observer.{a}_hat", f"controller.{a}_t"] for a in ("x", "y", "psi")]
    rows = int(np.floor(source.time[-1] / source.step + 1e-6))
    return {
        "name": "replay",
        "step": source.step,
        "stop": round(rows * source.step, 9),
        "fmus": fmus,
        "connections": connections,
        "recordings": [{"path": recording, "inputs": inputs}],
        "log": {"signals": [f"{name}.*" for name in fmus]},
    }
