"""Measured and predicted outputs of a calibration as figures."""

from collections.abc import Mapping, Sequence

import numpy as np

from ...report.document import Plot
from ...report.pictures.chart import AFTER, BEFORE, INK, Chart, ChartAxis, Panel
from ..residuals import WindowResiduals
from ..system_calibration import SystemCalibration


def plots_of(
    parts: Mapping[str, WindowResiduals], r: SystemCalibration, names: Sequence[str]
) -> list[Plot]:
    """Measured and predicted outputs of each run."""
    found = []
    for part in parts.values():
        before, after = part.raw([part.start, r.fit.setting if r.changed else part.start])
        for run in dict.fromkeys(w.run for w in part.windows):
            panels = []
            for k, name in enumerate(names):
                panel = Panel(ChartAxis("time [s]", shown=k == len(names) - 1), ChartAxis(name))
                mine = [
                    (w, rows) for w, rows in zip(part.windows, part.rows, strict=True) if w.run == run
                ]
                time = _joined([w.begin + w.time for w, _ in mine])
                y = _joined([w.measured[:, k] for w, _ in mine])
                panel.draw(time, y, INK, "measured", faint=True)
                changes = ((before, BEFORE, "before"), (after, AFTER, "after"))
                for off, colour, label in changes if r.changed else changes[:1]:
                    left = [off[rows].reshape(w.measured.shape)[:, k] for w, rows in mine]
                    panel.draw(time, y - _joined(left) * part.noise[k], colour, label)
                panels.append(panel)
            found.append(
                Plot(Chart(60.0 + 110.0 * len(panels), panels), f"{run}: measured and predicted.")
            )
    return found


def _joined(parts: Sequence[np.ndarray]) -> np.ndarray:
    """Parts one after the other, with NaN in between, at which a line breaks."""
    return np.concatenate([x for part in parts for x in (part, [np.nan])])[:-1]
