"""Output of the commands on a terminal of 80 columns, or in a pipe."""

from collections.abc import Iterable, Iterator, Sequence
from io import StringIO
from math import degrees

from rich.console import Console, Group, RenderableType
from rich.padding import Padding
from rich.table import Table
from rich.text import Text

from ..assessment.stability import Stability
from ..execution.short_text import SHOWN, WIDTH
from ..runs import MeasuredChannel, by_name, sensor_lines
from ..runs.measured_channels import UNUSED
from ..runs.run_constants import NEGLIGIBLE
from ..session import CalibratedModel
from .formatting import number, percent
from .headline import (
    boundedness,
    contradicted_by_tests,
    finding_sentence,
    gain_of_calibration,
    gain_of_search,
    headline,
    reading_of_commands,
    surest_first,
    verdict_title,
    worse_than_constant_velocities,
)
from .report_data import ReportData, seconds, trial_rows
from .reported_effect import ReportedEffect

WEIGH = ", in kg: weigh the ship"  # behind a mass beyond its prior
ASCII = str.maketrans("−–", "--")  # for any terminal


def as_text(shown: Iterable[RenderableType]) -> str:
    """Output as a text of 80 columns, without colours."""
    console = Console(file=StringIO(), width=WIDTH, highlight=False, markup=False, color_system=None)
    for part in shown:
        console.print(part)
    assert isinstance(console.file, StringIO)
    return "\n".join(map(str.rstrip, console.file.getvalue().splitlines())).rstrip()


def show_comparison(r: ReportData, out: str = "") -> Iterator[RenderableType]:
    """Output of ``diagnosis.compare``."""
    yield from _runs(r)
    yield from _errors(r)
    yield from _files(r, out)


def show_calibration(
    calibrated: CalibratedModel, r: ReportData, out: str = ""
) -> Iterator[RenderableType]:
    """Output of the second answer of ``diagnosis.learn``."""
    yield from _lines("Commands", reading_of_commands(calibrated))
    yield from _lines("Gain of the calibration", map(_plain, gain_of_calibration(calibrated, r)))
    moved = calibrated.learned.moved
    furthest = sorted(moved, key=lambda name: -abs(moved[name]))[:SHOWN]
    by = (f"{n} is {_number(calibrated.model.value(n))} ({_number(moved[n], 2)})" for n in furthest)
    title = "Coefficients with the largest changes (the change in standard deviations of the prior)"
    yield from _lines(title, by)
    yield from _errors(r)
    yield from _files(r, out)


def show_diagnosis(r: ReportData, out: str) -> Iterator[RenderableType]:
    """Output of the third answer of ``diagnosis.learn``; the first one has shown the data."""
    d = r.diagnosis
    assert d is not None
    yield from _lines("Commands", reading_of_commands(d))
    yield from _lines("Gain of the search", map(_plain, gain_of_search(r)))
    yield from _lines("Residual without explanation", [d.remainder.sentence])
    if not r.effects:
        yield from _lines("Finding", [headline(r)])
    for k, effect in enumerate(surest_first(r.effects), 1):
        title = f"Finding {k}: {effect.id}" if len(r.effects) > 1 else "Finding"
        yield from _lines(title, _effect(effect))
    small = [
        e for e in r.possibilities if e.in_model and max(e.confidence, e.share_of_error) < NEGLIGIBLE
    ]
    for effect in r.possibilities:
        if effect not in small:
            yield from _lines(f"Possibility: {effect.id}", _effect(effect))
    least = f"less than {_percent(NEGLIGIBLE)} of confidence and of the error"
    yield from _lines(
        f"In the learned model, each with {least}", (f"{e.id}: {e.equation}" for e in small)
    )
    yield from _lines("Rejected", [f"{w.id}: {w.reason}" for w in d.withdrawn])
    is_value = "in the learned model" if d.calibrated else "probably"
    suspects = [
        f"{s.name}: {is_value} {_number(s.value)} ({_number(s.z, 2)} standard deviations of "
        f"the prior){WEIGH * (s.name == 'm')}"
        for s in d.learned.suspects
    ]
    yield from _lines("Suspect coefficients", suspects)
    together = [f"Identifiable only together: {', '.join(group)}." for group in d.posterior.together]
    sure = [d.unrecorded.sentence, *together, *(f"Warning: {x}" for x in r.inseparable)]
    yield from _lines("Uncertainty of the values", sure)
    if r.accepted:
        first, *others = d.learned.ranking[: SHOWN + 1]
        behind = [f"{c.id} +{_number(c.behind)} (± {_number(c.behind_std, 2)})" for c in others]
        yield from _lines(
            "Best candidates, with the score difference to the first", [", ".join([first.id, *behind])]
        )
    yield from _errors(r)
    yield from _lines("Stability", _stability(d.stability))
    yield from _files(r, out)


def summary(r: ReportData) -> str:
    """The result of a diagnosis in at most ten lines."""
    d = r.diagnosis
    assert d is not None
    first = [*surest_first(r.effects), *r.possibilities][:SHOWN]
    runs = r.evaluations if len(r.evaluations) <= SHOWN else r.evaluations[: SHOWN - 1]
    lines = [f"{d.verdict}: {verdict_title(r)}"]
    lines += [f"  {finding_sentence(e)} [{_percent(e.confidence)}]" for e in first] or [
        f"  {headline(r)}"
    ]
    lines += [f"  {d.remainder.sentence}"]
    over = f"prediction error over {_number(r.lengths[0])} s"
    for e in runs:
        pair = " -> ".join(_number(1e3 * x, 2) for x in (e.before.position, e.after.position))
        lines.append(f"  {r.called(e)}: {over} {pair} mm")
    more = len(r.evaluations) - len(runs)
    lines += [f"  and {more} more runs"] if more > 0 else []
    return "\n".join(lines)


def _titled(title: str, body: RenderableType) -> Iterator[RenderableType]:
    yield Text(title, style="bold")
    yield Padding(body, (0, 0, 1, 2))


def _lines(title: str, lines: Iterable[str]) -> Iterator[RenderableType]:
    """Lines under a title; nothing where there is no line."""
    if text := "\n".join(lines):
        yield from _titled(title, Text(text))


def _files(r: ReportData, out: str) -> Iterator[RenderableType]:
    if r.files:
        yield Text(f"{', '.join(r.files)} in {out}", no_wrap=True, overflow="ignore")


def plain_table(*columns: str) -> Table:
    """An empty table of columns, the first with words, the others with numbers."""
    table = Table(box=None, pad_edge=False, padding=(0, 2, 0, 0))
    for k, name in enumerate(columns):
        table.add_column(Text(name), justify="right" if k else "left", overflow="fold")
    return table


def _runs(r: ReportData) -> Iterator[RenderableType]:
    """The data, what channels of each run say of each other, and where the model fails."""
    table = plain_table("run", "time", "samples", "frozen", "dropped", "spikes", "used")
    for e in r.evaluations:
        table.add_row(Text(r.called(e)), f"{_number(seconds(e), 4)} s", *map(str, e.smoothed.counts))
    yield from _titled("Data", table)
    yield from channel_table(r.channels)
    notes = [f"{e.name}: {note}" for e in r.evaluations for note in e.smoothed.notes]
    yield from _lines("Found in the data", notes)
    examined = [(e.name, e.smoothed.sensors) for e in r.evaluations]
    faults = [f"{run}: {line}" for run, x in examined if x for line in sensor_lines(x.findings)]
    yield from _lines("Faults that redundant channels show", faults)
    kind, sentences = r.how_it_predicts
    if kind:
        yield from _lines(f"Predictions of the {kind}", sentences)
    yield from _lines("Location of the model error", r.comparison.before.sentences)


def channel_table(
    of_runs: Sequence[tuple[str, Sequence[MeasuredChannel]]],
) -> Iterator[RenderableType]:
    """A row for each channel of some runs, by their names, and lines of what is longer than a cell."""
    table = plain_table("channel", "rate", "held", "noise", "", "outliers", "used")
    notes: dict[str, list[str]] = {}  # line -> the channels that it is of
    for c in by_name(c for _, channels in of_runs for c in channels):
        table.add_row(
            c.name,
            f"{_number(c.rate)} Hz",
            _percent(c.held),
            f"{'at most ' if c.noise_at_most else ''}{_number(c.noise, 2)} {c.unit}",
            c.noise_from if c.known else "uncertain",
            str(c.outliers),
            "yes" if c.used else "no",
        )
        runs = ((run, x) for run, channels in of_runs for x in channels if x.name == c.name)
        if found := next(((run, x.outlier_times[0]) for run, x in runs if x.outliers), None):
            notes.setdefault(f"first outlier in {found[0]} at {_number(found[1])} s", []).append(c.name)
        if c.why not in ("", UNUSED):
            notes.setdefault(f"not used: {c.why}", []).append(c.name)
    lines = Text("\n".join(f"{', '.join(names)}: {line}" for line, names in notes.items()))
    if of_runs:
        yield from _titled("Channels, medians of all runs", Group(table, lines) if notes else table)


def _effect(e: ReportedEffect) -> Iterator[str]:
    yield finding_sentence(e)
    yield e.equation
    if e.in_model:  # of another one there is no share in the learned model
        unique = f", unique contribution {_percent(e.share_unique)} (lost without this effect)"
        alone = "" if e.share_unique is None else unique
        explained = f"explains {_percent(e.share_of_error)} {e.of}{alone}"
        yield f"confidence {_percent(e.confidence)}, {explained}"
    yield from filter(None, (e.separation, e.advice))


def _errors(r: ReportData) -> Iterator[RenderableType]:
    """Errors of predictions, the model error, and what is measured of actuators and of trials."""
    predictions = plain_table("run", "position [mm]", "heading [°]")
    forces = plain_table("run", "X [N]", "Y [N]", "N [N m]")
    measured = plain_table("run", "measured output", "error [SI]")
    trials = plain_table("run", "measure", "measured", "predicted", "unit")

    def cell(before: float | None, after: float | None, scale: float = 1.0) -> str:
        parts = (before, after) if r.learned else (before,)
        return " -> ".join(_number(None if x is None else scale * x, 2) for x in parts)

    for e, outputs in zip(r.evaluations, r.measured, strict=True):
        run, b, a = Text(r.called(e)), e.before, e.after
        heading = cell(b.heading, a.heading, degrees(1.0))
        predictions.add_row(run, cell(b.position, a.position, 1e3), heading)
        forces.add_row(run, *(cell(*axis) for axis in zip(b.omega_rms, a.omega_rms, strict=True)))
        for name, errors in outputs.items():
            measured.add_row(run, name, cell(*errors))
    for row in trial_rows(r):
        predicted = cell(row.before, row.after)
        trials.add_row(Text(row.run), row.measure, _number(row.measured), predicted, row.unit)
    when = ", before -> after" if r.learned else ""
    for title, table in (
        (f"Prediction error over {_number(r.lengths[0])} s", predictions),
        ("Model error", forces),
        ("Measured and predicted outputs of actuators", measured),
        ("Manoeuvring trials, from just before the first execute", trials),
    ):
        if table.row_count:
            yield from _titled(f"{title}{when}", table)
    yield from _lines("Constant velocities", map(_plain, worse_than_constant_velocities(r)))
    yield from _lines("Test runs", map(_plain, contradicted_by_tests(r)))


def _stability(s: Stability) -> Iterator[str]:
    if not s.mass_definite:
        yield "The mass matrix of the learned model is not positive definite."
    yield f"{boundedness(s)}."
    yield (
        f"smallest dissipation {_number(s.learned_min_dissipation)} 1/s, of the initial model "
        f"{_number(s.nominal_min_dissipation)} 1/s"
    )
    if s.region:
        yield f"warning: less dissipation than the initial model: {s.region}"
    yield from s.notes


def _plain(text: str) -> str:
    """A text for any terminal."""
    return text.replace("→", "->").translate(ASCII)


def _number(x: float | None, digits: int = 3) -> str:
    return number(x, digits).translate(ASCII)


def _percent(x: float | None) -> str:
    return percent(x).translate(ASCII)
