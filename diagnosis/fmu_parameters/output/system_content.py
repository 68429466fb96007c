"""A calibration as JSON, as a parameter set, as text for the terminal, and as a page."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import RenderableType
from rich.table import Table
from rich.text import Text

import cosim
from cosim.fmu import FmuModel

from ...predictors.prediction import FAR_OFF
from ...report.content import part
from ...report.document import Document, Plot, ReportSection, numbers, write_document
from ...report.document import Table as PageTable
from ...report.formatting import write_json
from ...report.pictures.chart import AFTER, BEFORE, INK, Chart, ChartAxis, Panel
from ...report.pictures.figures import interrupted
from ...report.report_data import USES
from ...runs.cleaning import Z95
from ..additional_force import AdditionalForce
from ..calibration_task import CalibrationTask
from ..force_search import Accepted
from ..parameter_file import unit_of
from ..residuals import WindowResiduals
from ..system_calibration import CalibratedValue, SystemCalibration

FILES = ("diagnosis.json", "model.ssv", "posterior.json", "report.html")
SENTENCES = {
    "parameters": "Parameters of the FMU differ from their values, and no other error is detected.",
    "found": "The FMU lacks an additional force.",
    "ambiguous": "The runs do not discriminate the parameters or forces that may be the cause.",
    "unexplained": "Neither parameters nor additional forces explain the runs.",
    "none": "The FMU agrees with the runs; nothing was learned.",
}


@dataclass(frozen=True, eq=False)
class CalibrationReport:
    """All that is written of a calibration.

    Attributes:
        result: the calibration.
        task: what was calibrated.
        samples: number of measured values that were learned from.
        made_of: files and options, for ``cybership next``.
        files: that are written.
    """

    result: SystemCalibration
    task: CalibrationTask
    samples: int
    made_of: Mapping[str, object]
    files: list[str] = field(default_factory=lambda: [*FILES])

    @property
    def model(self) -> FmuModel:
        """The FMU."""
        return self.task.confined.model

    def force_unit(self, f: AdditionalForce) -> str:
        """Unit of a force's coefficient."""
        every = self.model.variables
        return f.unit(unit_of(every[f.input]), unit_of(every[f.output]) if f.output else "1")

    def force_interval(self, k: int) -> tuple[float, float]:
        """95 % interval of a force's coefficient."""
        fit, p = self.result.fit, len(self.result.values)
        value = fit.setting.forces[k].coefficient
        std = float(np.sqrt(self.result.covariance[p + k, p + k])) * fit.sizes[k]
        return value - Z95 * std, value + Z95 * std

    @property
    def sentence(self) -> str:
        """The verdict in a sentence or two."""
        r = self.result
        text = SENTENCES[r.verdict]
        off = [v.parameter.name for v in r.values if v.moved]
        if r.verdict in ("found", "ambiguous") and off and r.forces:
            text += f" Parameters differ as well: {', '.join(off)}."
        if far := [v.parameter.name for v in r.values if abs(v.z) > FAR_OFF and v.moved]:
            text += (
                f" Beyond three prior standard deviations: {', '.join(far)}; check the value or "
                "the prior."
            )
        if r.rejected:
            text += f" The fitted values are rejected: {r.rejected}."
        return text

    def _change(self, run: str) -> dict[str, Any]:
        if run not in self.result.changes:
            return {}
        squares, error = self.result.changes[run]
        return {"change": {"squares": squares, "standard_error": error}}

    def content(self) -> dict[str, Any]:
        """``diagnosis.json``."""
        r, task, fmu = self.result, self.task, self.task.confined
        units = dict(zip(task.names, task.units, strict=True))
        return {
            "verdict": r.verdict,
            "sentence": self.sentence,
            "parameters": [*map(_parameter, r.values)],
            "effects": [self._effect(k, f) for k, f in enumerate(r.forces)],
            "indistinguishable_groups": [list(group) for group in r.together],
            "remainder": {
                "significant": r.remainder.significant,
                "outputs": {o.name: part(o, "rms unit share p") for o in r.remainder.outputs},
                "sentence": r.remainder.sentence,
            },
            "possibilities": [],
            "withdrawn": [{"id": "parameters", "reason": r.rejected}] if r.rejected else [],
            "suspect_coefficients": [
                part(v, "name=parameter.name z value") for v in r.values if abs(v.z) > FAR_OFF
            ],
            "ranking": [],
            "data": {"samples": self.samples, "used": self.samples},
            "errors": [
                {
                    "run": run,
                    "use": task.use[run],
                    "held_out": task.use[run] == "test",
                    "outputs": {
                        n: {"before": before, "after": after, "unit": units[n]}
                        for n, (before, after) in each.items()
                    },
                    **self._change(run),
                }
                for run, each in r.errors.items()
            ],
            "fmu": {
                "name": self.model.path.name,
                "sha256": self.model.sha256,
                "map": task.content,
                "faults": list(r.faults),
                "notes": list(task.notes),
                "confinement": fmu.confinement,
                "outside": list(fmu.outside),
            },
        }

    def _effect(self, k: int, f: Accepted) -> dict[str, Any]:
        value = {
            "value": f.force.coefficient,
            "unit": self.force_unit(f.force),
            "ci95": [*self.force_interval(k)],
        }
        return {
            "id": f.force.id,
            "input": ", ".join(f.force.inputs),
            "axis": "",
            "coefficients": {f.force.id: value},
            "confidence": f.probability,
            "share_of_error": 1.0 - float(np.mean([o.share for o in self.result.remainder.outputs])),
            "indistinguishable": list(f.alike),
            "advice": advice(f),
        }

    def write(self, folder: Path, origin: Mapping[str, str], plots: Sequence[Plot]) -> None:
        """Write all files but those of an FMU."""
        write_json(folder / "diagnosis.json", self.content())
        own = {v.parameter.name: v for v in self.result.values} if self.result.changed else {}
        values = {
            n: cosim.Parameter(v.value, None if v.parameter.unit == "1" else v.parameter.unit)
            for n, v in own.items()
        }
        units = {v.unit.name: v.unit for n in own if (v := self.model.variables[n]).unit is not None}
        stated = {
            name: {
                **{b: float(e) for b, e in zip(cosim.BASE_UNITS, u.exponents or (), strict=False) if e},
                "factor": u.factor,
                "offset": u.offset,
            }
            for name, u in units.items()
            if u is not None and u.exponents is not None
        }
        name = self.model.name
        cosim.write_parameters(
            folder / "model.ssv",
            cosim.ParameterSet(values={name: values} if values else {}, units=stated, name="calibrated"),
        )
        write_json(folder / "posterior.json", self._posterior() | {"task": self.made_of})
        sections = [*self._sections(plots)]
        page = Document("Calibration of an FMU", self.sentence, sections, origin)
        write_document(folder / "report.html", page)

    def _posterior(self) -> dict[str, Any]:
        r = self.result
        z = r.fit.setting.z
        slopes = [v.parameter.slope(x) for v, x in zip(r.values, z, strict=True)]
        scale = np.array([*slopes, *r.fit.sizes])
        forces = r.fit.setting.forces
        names = [v.parameter.name for v in r.values]
        return {
            "names": [*(f"{self.model.name}.{n}" for n in names), *(f.id for f in forces)],
            "units": [
                *(v.parameter.unit for v in r.values),
                *map(self.force_unit, forces),
            ],
            "mean": [
                *(v.parameter.at(x) for v, x in zip(r.values, z, strict=True)),
                *(f.coefficient for f in forces),
            ],
            "covariance": (r.covariance * np.outer(scale, scale)).tolist(),
        }

    def rows(self) -> Iterator[list[str]]:
        """Rows of the table of parameters."""
        for v in self.result.values:
            p = v.parameter
            value, low, high, start = numbers([v.value, *v.ci95, p.value], 4)
            yield [p.name, start, value, f"{low} to {high}", p.unit, "off" if v.moved else ""]

    def force_rows(self) -> Iterator[list[str]]:
        """Rows of the table of additional forces."""
        for k, f in enumerate(self.result.forces):
            value, low, high = numbers([f.force.coefficient, *self.force_interval(k)], 4)
            alike = ", ".join(f.alike) or "-"
            yield [
                f.force.id,
                value,
                f"{low} to {high}",
                self.force_unit(f.force),
                f"{f.probability:.0%}",
                alike,
            ]

    def error_rows(self) -> Iterator[list[str]]:
        """Rows of the table of errors."""
        units = dict(zip(self.task.names, self.task.units, strict=True))
        for run, each in self.result.errors.items():
            for n, (before, after) in each.items():
                yield [f"{run} ({USES[self.task.use[run]]})", n, *numbers([before, after]), units[n]]

    def _sections(self, plots: Sequence[Plot] = ()) -> Iterator[ReportSection]:
        r = self.result
        if r.values:
            yield ReportSection("Parameters", tables=[PageTable(PARAMETERS, [*self.rows()], True)])
        if r.forces:
            text = [advice(f) for f in r.forces if advice(f)]
            table = PageTable(FORCES, [*self.force_rows()], True)
            yield ReportSection("Additional forces", text, [table])
        if r.together:
            groups = [f"Identifiable only together: {', '.join(group)}." for group in r.together]
            yield ReportSection("Not identifiable alone", [*groups, ALONE])
        table = PageTable(ERRORS, [*self.error_rows()], True)
        yield ReportSection("Errors", [r.remainder.sentence], [table], plots)
        yield ReportSection(
            "Notes", [*self.result.faults, *self.task.notes, *self.task.confined.sentences()]
        )

    def shown(self, out: str) -> Iterator[RenderableType]:
        """The answer on the terminal."""
        yield Text(self.sentence, "bold")
        for section in self._sections():
            yield from map(_table, section.tables)
            yield from section.text
        yield f"Files in {out}: {', '.join(self.files)}"


ALONE = "To identify one of them alone, leave known ones out of the file of parameters."
PARAMETERS = ("parameter", "start", "value", "95 % interval", "unit", "")
FORCES = ("force", "coefficient", "95 % interval", "unit", "confidence", "indistinguishable")
ERRORS = ("run", "output", "rms before", "rms after", "unit")


def _parameter(v: CalibratedValue) -> dict[str, Any]:
    known = part(v, "name=parameter.name unit=parameter.unit value ci95")
    prior = part(v.parameter, "value std log origin=prior.origin")
    return known | {"prior": prior} | part(v, "z moved")


def advice(f: Accepted) -> str:
    """Which run would discriminate; empty: none is needed."""
    if not f.alike:
        return ""
    others = ", ".join(f.alike)
    if f.force.output:
        return (
            f"{f.force.id} is indistinguishable from {others}: run with other levels of "
            f"{f.force.output}."
        )
    return f"{f.force.id} is indistinguishable from {others}: run with more motion."


def _table(of: PageTable) -> Table:
    made = Table(box=None, pad_edge=False, header_style="")
    for k, name in enumerate(of.header):
        side = "left" if k in (0, len(of.header) - 1) else "right"
        made.add_column(name, justify=side, overflow="fold")
    for row in of.rows:
        made.add_row(*map(Text, row))
    return made


def plots_of(
    parts: Mapping[str, WindowResiduals], r: SystemCalibration, names: Sequence[str]
) -> list[Plot]:
    """Measured and predicted outputs of each run."""
    found = []
    for own in parts.values():
        before, after = own.raw([own.start, r.fit.setting if r.changed else own.start])
        for run in dict.fromkeys(w.run for w in own.windows):
            windows = [w for w in own.windows if w.run == run]
            group = np.repeat(np.arange(len(windows)), [w.time.size for w in windows])
            time = interrupted(np.concatenate([w.begin + w.time for w in windows]), group)
            measured = interrupted(np.concatenate([w.measured for w in windows]), group)
            left = [
                interrupted(np.concatenate([x.reshape(w.measured.shape) for w, x in mine]), group)
                for each in (before, after)
                for mine in [[(w, x) for w, x in own.parts(each) if w.run == run]]
            ]
            changes = ((left[0], BEFORE, "before"), (left[1], AFTER, "after"))
            panels = []
            for k, name in enumerate(names):
                panel = Panel(ChartAxis("time [s]", shown=k == len(names) - 1), ChartAxis(name))
                panel.draw(time, measured[:, k], INK, "measured", faint=True)
                for off, colour, label in changes if r.changed else changes[:1]:
                    panel.draw(time, measured[:, k] - off[:, k] * own.noise[k], colour, label)
                panels.append(panel)
            found.append(
                Plot(Chart(60.0 + 110.0 * len(panels), panels), f"{run}: measured and predicted.")
            )
    return found
