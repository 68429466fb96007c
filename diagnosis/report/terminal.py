"""Output of the commands on a terminal of 80 columns, or in a pipe."""

from collections.abc import Iterable, Iterator, Sequence
from math import degrees

from rich.console import RenderableType
from rich.padding import Padding
from rich.table import Table
from rich.text import Text

from ..runs import sensor_lines
from .headline import is_sure, told, verdict_title
from .result_keys import ComparisonContent, Data, DiagnosisContent, EffectResult, SensorResult
from .trial_rows import trial_rows

MAX_CANDIDATES = 5  # of the ranking; chosen
MAX_SUMMARY = 3  # effects and runs in the summary: ten lines in all


def show_comparison(r: ComparisonContent, out: str) -> Iterator[RenderableType]:
    """Output of ``diagnosis.compare``."""
    yield from _data(r.data)
    yield from _sensors(r.sensors)
    yield from _where(r)
    yield from _errors(r, learned=False)
    yield from _files(r.files, out)


def _where(r: ComparisonContent | DiagnosisContent) -> Iterator[RenderableType]:
    if r.fmu is not None:
        yield from _lines(f"How the {r.fmu.kind} predicts", r.fmu.sentences)
    yield from _lines("Where the model fails", r.where.sentences)


def show_diagnosis(r: DiagnosisContent, out: str) -> Iterator[RenderableType]:
    """Output of ``diagnosis.learn``."""
    yield from _data(r.data)
    yield from _sensors(r.sensors)
    yield from _where(r)
    yield from _lines("What is left without an explanation", [r.remainder.sentence])
    if not r.effects:
        yield from _lines("Finding", [r.sentence])
    several = len(r.effects) > 1
    for k, effect in enumerate(
        sorted(r.effects, key=lambda e: not is_sure(e)), 1
    ):  # the sure ones first
        yield from _lines(f"Finding {k}: {effect.id}" if several else "Finding", _effect(effect))
    for effect in r.possibilities:
        yield from _lines(f"Possibility: {effect.id}", _effect(effect))
    if r.withdrawn:
        yield from _lines("Withdrawn", [f"{w.id}: {w.reason}" for w in r.withdrawn])
    if r.suspect_coefficients:
        suspects = [
            f"{s.name} is rather {_number(s.value)} ({_number(s.z, 2)} standard deviations of the prior)"
            for s in r.suspect_coefficients
        ]
        yield from _lines("Suspect coefficients", suspects)
    together = [f"Known only together: {', '.join(group)}." for group in r.correlation.together]
    sure = [r.unrecorded.sentence, *together, *(f"Warning: {x}" for x in r.inseparable)]
    yield from _lines("How sure the values are", sure)
    if r.effects or r.possibilities:
        first, *others = r.ranking[:MAX_CANDIDATES]
        behind = [f"{c.id} +{_number(c.behind)} (± {_number(c.behind_std, 2)})" for c in others]
        yield from _lines(
            "Best candidates, by how much worse than the first", [", ".join([first.id, *behind])]
        )
    yield from _errors(r, learned=has_learned(r))
    yield from _lines("Stability", _stability(r))
    yield from _files(r.files, out)


def summary(r: DiagnosisContent) -> str:
    """The result in at most ten lines."""
    first = [*sorted(r.effects, key=lambda e: not is_sure(e)), *r.possibilities][:MAX_SUMMARY]
    lines = [f"{r.verdict}: {verdict_title(r)}"]
    lines += [f"  {told(e)} [{_percent(e.confidence)}]" for e in first] or [f"  {r.sentence}"]
    lines += [f"  {r.remainder.sentence}"]
    for e in r.errors[:MAX_SUMMARY]:
        position = e.window_position_rmse
        pair = " -> ".join(
            _number(None if x is None else 1e3 * x, 2) for x in (position.before, position.after)
        )
        held_out = " (held out)" if e.held_out else ""
        lines.append(
            f"  {e.run}{held_out}: predictions over {_number(r.windows.prediction)} s miss by {pair} mm"
        )
    more = len(r.errors) - MAX_SUMMARY
    lines += [f"  and {more} more runs"] if more > 0 else []
    return "\n".join(lines)


def _titled(title: str, body: RenderableType) -> Iterator[RenderableType]:
    yield Text(title, style="bold")
    yield Padding(body, (0, 0, 1, 2))


def _lines(title: str, lines: Iterable[str]) -> Iterator[RenderableType]:
    yield from _titled(title, Text("\n".join(lines)))


def _files(files: Sequence[str], out: str) -> Iterator[RenderableType]:
    yield Text(f"{', '.join(files)} in {out}", no_wrap=True, overflow="ignore")


def _table(*columns: str) -> Table:
    table = Table(box=None, pad_edge=False, padding=(0, 2, 0, 0))
    for k, name in enumerate(columns):
        table.add_column(Text(name), justify="right" if k else "left", overflow="fold")
    return table


def _data(data: Data) -> Iterator[RenderableType]:
    table = _table("run", "time", "samples", "frozen", "dropped", "spikes", "used")
    for r in data.runs:
        seconds = f"{_number(r.seconds, 4)} s"
        counts = (r.samples, r.frozen, r.dropped, r.spikes, r.used)
        table.add_row(_run(r.run, r.held_out), seconds, *map(str, counts))
    yield from _titled("Data", table)
    notes = [f"{r.run}: {note}" for r in data.runs for note in r.notes]
    if notes:
        yield from _lines("Found in the data", notes)


def _sensors(found: Sequence[SensorResult]) -> Iterator[RenderableType]:
    """What the channels of each run say of each other."""
    lines = [f"{run}: {line}" for run in dict.fromkeys(f.run for f in found) for line in
             sensor_lines([f for f in found if f.run == run])]  # fmt: skip
    if lines:
        yield from _lines("What channels say of each other", lines)


def _run(name: str, held_out: bool) -> Text:
    return Text(f"{name} (held out)" if held_out else name)


def has_learned(r: DiagnosisContent) -> bool:
    """Whether the learned model is another than the one at first."""
    fitted = r.calibrated or r.verdict == "coefficients"
    return bool(r.effects) or fitted or any(p.in_model for p in r.possibilities)


def _effect(e: EffectResult) -> Iterator[str]:
    yield told(e)
    yield e.equation
    share = _percent(e.share_of_error)
    alone = "" if e.share_unique is None else f", {_percent(e.share_unique)} that nothing else does"
    yield f"confidence {_percent(e.confidence)}, takes away {share} of the squared error{alone}"
    yield from filter(None, (e.separation, e.advice))


def _errors(r: ComparisonContent | DiagnosisContent, learned: bool) -> Iterator[RenderableType]:
    """Window prediction error, and RMS of the model error."""
    predictions, forces = (
        _table("run", "position [mm]", "heading [°]"),
        _table("run", "X [N]", "Y [N]", "N [N m]"),
    )

    def cell(before: float | None, after: float | None, scale: float = 1.0) -> str:
        parts = (before, after) if learned else (before,)
        return " -> ".join(_number(None if x is None else scale * x, 2) for x in parts)

    for e in r.errors:
        run, position, heading = _run(e.run, e.held_out), e.window_position_rmse, e.window_heading_rmse
        millimetres = cell(position.before, position.after, 1e3)
        predictions.add_row(run, millimetres, cell(heading.before, heading.after, degrees(1.0)))
        axes = zip(e.omega_rms.before, e.omega_rms.after, strict=True)
        forces.add_row(run, *(cell(b, a) for b, a in axes))
    when = ", before -> after" if learned else ""
    yield from _titled(f"Predictions over {_number(r.windows.prediction)} s miss by{when}", predictions)
    yield from _titled(f"Force that the model lacks{when}", forces)
    measured = _table("run", "what is measured", "off by [SI]")
    for e in r.errors:
        for name, m in e.measured.items():
            measured.add_row(_run(e.run, e.held_out), name, cell(m.rms_before, m.rms_after))
    if measured.row_count:
        yield from _titled(f"Measured outputs of actuators and the model's{when}", measured)
    trials = _table("run", "measure", "measured", "predicted", "unit")
    for row in trial_rows(r.errors):
        predicted = cell(row.before, row.after)
        trials.add_row(
            _run(row.run, row.held_out), row.measure, _number(row.measured), predicted, row.unit
        )
    if trials.row_count:
        yield from _titled(f"Manoeuvring trials, from just before the first execute{when}", trials)


def _stability(r: DiagnosisContent) -> Iterator[str]:
    s = r.stability
    if not s.mass_definite:
        yield "The mass matrix of the learned model is not positive definite."
    bounded = "stays bounded" if s.bounded else "does NOT stay bounded"
    where = "In closed loop" if s.closed_loop else "Without thrust"
    yield f"{where} the learned model {bounded}{' on the reference paths' if s.closed_loop else ''}."
    yield (
        f"smallest dissipation {_number(s.learned_min_dissipation)} 1/s, "
        f"of the model at first {_number(s.nominal_min_dissipation)} 1/s"
    )
    if s.region:
        yield f"warning: less dissipation than at first: {s.region}"
    yield from s.notes


def _number(x: float | None, digits: int = 3) -> str:
    """A number for people."""
    if x is None:
        return "-"
    return f"{x:.0f}" if abs(x) >= 10.0**digits else f"{x:.{digits}g}"


def _percent(x: float | None, decimals: int = 0) -> str:
    return "-" if x is None else f"{100.0 * x:.{decimals}f} %"
