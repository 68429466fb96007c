"""Simulates the runs of the cases, and prepares the public measurements, as files that commands read."""

import json
import os
import subprocess
import sys
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from shutil import copyfile
from typing import Any

import numpy as np
import pandas as pd

from diagnosis import Run
from diagnosis.predictors import ship_with

from .. import ship_effects
from ..hidden_effects import problems as hidden
from ..hidden_effects.cells import Cell
from ..hidden_effects.fleet import Order, sail_all
from ..hidden_effects.manoeuvres import manoeuvres
from ..hidden_effects.simulated_runs import Hidden, Voyage
from ..sensor_faults import FAULTS as SENSOR_FAULTS
from ..sensor_faults import HIDDEN, voyages
from ..spoilt_files.outcomes import table
from ..spoilt_files.ways import WAYS
from .command_lines import CELLS, DESCRIBED, FAULTS, MEASURED, SPOILT

ROOT = Path(__file__).parents[2]
DATA = Path(os.environ.get("CYBERSHIP_DATA", ROOT.parent / "shared" / "data"))
COLUMNS = ["time", "x", "y", "psi", "tau_X", "tau_Y", "tau_N"]
HALF = 1200  # samples of a run of a described ship: half of it
# Ships that allocate no forces: shaft speed [1/s] and rudder [rad]; angle [rad] and speed [1/s].
RANGES = {"kvlcc2": ((8.0, 12.0), (-0.5, 0.5)), "gunnerus": ((-0.5, 0.5), (1.5, 3.0))}
# A ship that only its FMU knows: heavier than CyberShip Enterprise 1, with another drag.
VENDOR = {"m": 18.0, "X_u": -1.2, "Y_v": -3.0, "N_r": -0.3, "X_udot": -1.0, "delta_N_uv": 0.5}
OWN_EFFECTS = '''"""A moment that a user suspects."""

from typing import Annotated

from fmus.effects import effect


@effect("N_uuv", kind="force", axis="N", formula="N = k u u v", symbol="k")
def N_uuv(ship, N_uuv: Annotated[float, "N.s3/m3", "moment by u u v"] = 0.0):
    """A drift at speed turns the ship."""
    return 0.0, 0.0, N_uuv * ship.u * ship.u * ship.v
'''
OWN_NAMES = {
    "separator": ";",
    "decimal": ",",
    "columns": {
        "time": {"name": "t", "unit": "ms"},
        "x": "North",
        "y": {"name": "West", "unit": "mm", "flip": True},
        "psi": {"name": "Heading", "unit": "deg"},
    },
}
TANKER = {
    "trial": "zigzag",
    "columns": {
        "time": "t",
        "psi": {"name": "psi_deg", "unit": "deg"},
        "rudder.delta": {"name": "rudder_deg", "unit": "deg", "flip": True},
        "propeller.n": "rps",
        "propeller.thrust": "thrust",
    },
}
RESEARCH_VESSEL = {
    "columns": {
        "time": "tvec",
        "x": "N",
        "y": "E",
        "psi": {"name": "psi", "unit": "deg"},
        "r": {"name": "r", "unit": "deg/s"},
        "azimuth.alpha": {"name": "Azi", "unit": "deg"},
        "azimuth.n": {"name": "RPM", "unit": "rpm"},
    }
}
# Seconds of the log of the research vessel's first trial.
STRETCHES = {"circle": (470.0, 684.0), "zigzag": (1606.0, 1779.0), "starboard": (1215.0, 1399.0)}


def make(folder: Path) -> None:
    """Write all files of the cases; measurements only where ``CYBERSHIP_DATA`` has them.

    Args:
        folder: for the files; problems of the benchmark that are there already are kept.
    """
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "own_effects.py").write_text(OWN_EFFECTS, encoding="utf-8")
    write_parameters(folder / "hidden.ssv", HIDDEN)
    for step in (cells, ships, foreign, log, faults, measured):
        print(step.__name__, flush=True)
        step(folder)


def cells(folder: Path) -> None:
    """Runs of CyberShip Enterprise 1 with hidden effects, and the first in other forms of file."""
    named = {name: Cell(c.effects, c.noise, c.wrong, 0) for name, c in CELLS.items()}
    kept = folder / "simulated"
    for _ in hidden.make(list(named.values()), kept):
        pass
    for name, cell in named.items():
        for k, run in enumerate(hidden.kept(cell.key, kept).runs, 1):
            write_run(folder / "cells" / name / f"run{k}.csv", run, CELLS[name].seconds)
    first = pd.read_csv(folder / "cells" / "X_u" / "run1.csv")
    first.to_parquet(folder / "X_u.parquet", index=False)
    own = pd.DataFrame(
        {
            "t": 1e3 * first.time,
            "North": first.x,
            "West": -1e3 * first.y,
            "Heading": np.degrees(first.psi),
            **{name: first[name] for name in COLUMNS[4:]},
        }
    )
    own.to_csv(folder / "own_names.csv", sep=";", decimal=",", index=False)
    write_beside(folder / "own_names.csv", OWN_NAMES)


def ships(folder: Path) -> None:
    """Runs of described ships."""
    for name, (ship_name, cause_name, wrong) in DESCRIBED.items():
        ship = ship_with((), ship_name)
        cause = ship_effects.causes(ship)[cause_name]
        rng = np.random.default_rng([0, *name.encode()])
        for k in (1, 2, 3):
            orders = steered(RANGES[ship_name], rng) if ship_name in RANGES else None
            run = ship_effects.sail(ship, cause, rng, 0 if wrong else None, orders)
            write_table(folder / "ships" / name / f"run{k}.csv", run.iloc[:HALF])


def steered(
    ranges: Sequence[tuple[float, float]], rng: np.random.Generator
) -> Iterator[tuple[float, ...]]:
    """Commands at random within ranges, each for 2 to 6 s at the size of CyberShip Enterprise 1."""
    while True:
        now = tuple(rng.uniform(low, high) for low, high in ranges)
        seconds = rng.uniform(2.0, 6.0)
        for _ in range(round(seconds / ship_effects.PERIOD) * ship_effects.EVERY):
            yield now


def foreign(folder: Path) -> None:
    """The FMU of a ship that only its maker knows, and runs of it with a drag that the FMU lacks."""
    place = folder / "fmu"
    place.mkdir(exist_ok=True)
    write_parameters(place / "vendor.ssv", VENDOR)
    options = ["--parameters", "vendor.ssv", "--out", ".", "--overwrite", "--native"]
    run_module(place, "fmus.build", "vessel", *options)
    (place / "vessel.fmu").replace(place / "vendor.fmu")
    for name, more in {"drag": {"delta_X_u": -2.0}, "none": {}}.items():
        orders = [Order(m, Hidden(VENDOR | more), 1.0, k) for k, m in enumerate(manoeuvres(1)[:2])]
        for k, voyage in enumerate(sail_all(orders), 1):
            if not isinstance(voyage, Voyage):
                raise voyage
            write_run(place / f"{name}{k}.csv", voyage.measured, 80.0)


def log(folder: Path) -> None:
    """A log of the master, of a ship with more drag, and spoilt copies of it."""
    scenario, parameters = ROOT / "scenarios" / "ellipse.json", ROOT / "scenarios" / "hidden.ssv"
    options = ["--parameters", str(parameters), "--out", "log", "--overwrite", "--no-plots", "--quiet"]
    run_module(folder, "cosim.run", str(scenario), "--stop", "100", *options)
    good = table(folder / "log")
    for k, way in enumerate(SPOILT):
        spoilt = WAYS[way].spoil(good.copy(), np.random.default_rng(k))
        write_table(folder / "spoilt" / f"{way}.csv", spoilt)


def faults(folder: Path) -> None:
    """Runs with velocity and yaw rate, in which a sensor is wrong."""
    _, run = next(iter(voyages(1, HIDDEN)))
    for name in FAULTS:
        wrong = SENSOR_FAULTS[name].put(run)
        write_run(folder / "faults" / f"{name.replace(' ', '_')}.csv", wrong, run.time[-1])


def measured(folder: Path) -> None:
    """The public measurements that the cases read, each with the file that explains its columns."""
    if not DATA.is_dir():
        print(f"no measurements: CYBERSHIP_DATA names no folder, and there is no '{DATA}'")
        return
    place = folder / MEASURED
    place.mkdir(exist_ok=True)
    for name in ("run1", "random_run1", "dptest1"):
        copyfile(DATA / "cse1" / f"{name}.mat", place / f"{name}.mat")
    for name in ("z_10_10_p", "z_10_10_s", "z_20_10_p", "z_20_10_s"):
        copyfile(DATA / "kvlcc2_hsva" / f"{name}.csv", place / f"{name}.csv")
        write_beside(place / f"{name}.csv", TANKER)
    trial = pd.read_csv(DATA / "gunnerus" / "trial_1.csv")
    for name, (start, end) in STRETCHES.items():
        write_table(place / f"{name}.csv", trial.loc[trial.tvec.between(start, end)])
        write_beside(place / f"{name}.csv", RESEARCH_VESSEL)


def write_run(path: Path, run: Run, seconds: float) -> None:
    """The first seconds of a run, with all that is measured in addition to the pose."""
    part = run.rows(run.time <= run.time[0] + seconds)
    columns = pd.DataFrame(np.column_stack([part.time, part.pose, part.tau_cmd]), columns=COLUMNS)
    write_table(path, columns.assign(**part.measured))


def write_table(path: Path, content: pd.DataFrame) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    content.to_csv(path, index=False)


def write_beside(path: Path, content: Mapping[str, Any]) -> None:
    """The file next to a measurement that explains its columns."""
    path.with_name(f"{path.name}.json").write_text(json.dumps(content, indent=2), encoding="utf-8")


def write_parameters(path: Path, vessel: Mapping[str, float]) -> None:
    """A parameter set (SSP 1.0) of the vessel."""
    values = "".join(
        f'<ssv:Parameter name="vessel.{name}"><ssv:Real value="{value!r}"/></ssv:Parameter>'
        for name, value in vessel.items()
    )
    space = "http://ssp-standard.org/SSP1/SystemStructureParameterValues"
    path.write_text(
        f'<?xml version="1.0" encoding="UTF-8"?>\n<ssv:ParameterSet xmlns:ssv="{space}" version="1.0" '
        f'name="{path.stem}"><ssv:Parameters>{values}</ssv:Parameters></ssv:ParameterSet>\n',
        encoding="utf-8",
    )


def run_module(folder: Path, *command: str) -> None:
    """Run a module of this project in a folder."""
    env = os.environ | {"PYTHONPATH": str(ROOT)}
    subprocess.run([sys.executable, "-m", *command], cwd=folder, env=env, check=True)
