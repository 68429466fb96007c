"""A run of which force and z1 were lost in part, and its replay (7.1, Fig. 7.1)."""

import json
import shutil
from pathlib import Path

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

import cosim
from studies.study_report import Report, Verdict

from ..monte_carlo import Content
from ..open_loop import gather_source, loop_of, play
from ..tracking.outcome import AXES, Log
from .lap_pictures import UNITS

Z1 = tuple(f"controller.z1_{n}" for n in ("x", "y", "psi"))
GONE = [*Z1, *(f"thrusters.tau_cmd_{a}" for a in AXES)]
SHARE = 0.99  # 1, of the samples that are lost; chosen: few points of Fig. 7.1 are measured
EXACT = 1e-9  # m and rad; what rounding may change


def lossy(whole: Path, folder: Path) -> Path:
    """A copy of a run, of which most samples of force and z1 are lost, as by the laboratory's Wi-Fi."""
    folder.mkdir(parents=True, exist_ok=True)
    log = pd.read_csv(whole / "log.csv")
    log.loc[np.random.default_rng(0).random(len(log)) < SHARE, GONE] = np.nan
    log.to_csv(folder / "log.csv", index=False, na_rep="nan")
    shutil.copy(whole / "log.json", folder / "log.json")
    return folder


def came_back(whole: Log, found: dict[str, np.ndarray]) -> Verdict:
    """Whether the replay gives the z1 that the run had."""
    off = {name: float(np.abs(found[name] - whole[name]).max()) for name in Z1}
    return Verdict(
        "A replay gives the signals that were lost (7.1, Fig. 7.1)",
        max(off.values()) < EXACT,
        f"largest difference of z1 to the run before the loss, limit {EXACT:g}: "
        + ", ".join(f"{x:.2g} {unit}" for x, unit in zip(off.values(), UNITS, strict=True)),
    )


def picture(measured: Log, found: dict[str, np.ndarray], time: np.ndarray) -> Figure:
    """z1 of the run where it was not lost, as points, over that of the replay."""
    figure = Figure(figsize=(8.0, 6.0), layout="constrained")
    panels = figure.subplots(3, 1, sharex=True)
    for panel, name, unit in zip(panels, Z1, UNITS, strict=True):
        panel.plot(time, found[name], color="blue", linewidth=0.8, label="replay")
        panel.plot(time, measured[name], ".", color="red", markersize=1.0, label="measured")
        panel.set_ylabel(f"{name.partition('.')[2]} [{unit}]")
    panels[0].legend(fontsize=7, ncols=2)
    panels[-1].set_xlabel("time [s]")
    return figure


def write_replay(report: Report, run: Path, content: Content, scratch: Path) -> None:
    """Lose signals of a run with CLE, replay it, and compare.

    Args:
        report: gets verdict and picture.
        run: folder of the log.
        content: of its scenario.
        scratch: folder for the run with the loss.
    """
    lost, scenario = lossy(run, scratch), scratch / "scenario.json"
    scenario.write_text(json.dumps(content), encoding="utf-8")
    played = play(gather_source(lost), loop_of(lost, "cl_win_eps", None, scenario))
    found = {name: played.at_samples(name) for name in Z1}
    report.heading("Signals that were lost (7.1)")
    report.verdicts("lost_signals", [came_back(cosim.read_log(run), found)])
    shown = picture(cosim.read_log(lost), found, played.source.time)
    caption = f"z1 of the eight with CLE, {100.0 * SHARE:g} % of the samples lost (Fig. 7.1)."
    report.figure("lost_signals", shown, caption)
