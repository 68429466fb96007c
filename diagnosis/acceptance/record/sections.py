"""The report of a record as sections with tables, for the page and for the PDF alike."""

from collections.abc import Iterator

from ...report.content import Content
from ...report.document import ReportSection, Table
from ...report.formatting import NO_VALUE, number

SOURCES = ("u_D", "initial_state", "parameters", "process_noise", "current", "wind", "u_num", "u_val")
CALLED = {
    "u_D": "measurement u_D",
    "initial_state": "initial state",
    "process_noise": "process noise",
}
UNKNOWN = "not known"


def sections(r: Content) -> Iterator[ReportSection]:
    """The report, in order."""
    yield _verdict(r)
    yield _judged(r)
    yield _errors(r)
    yield _uncertainty(r)
    stated = [(name, text) for name, text in r.particulars.items()]
    purpose = [f"Intended use: {r.criteria.purpose or 'not given'}. As the criteria state:"]
    yield ReportSection("Particulars", purpose, [Table(("", ""), stated, words=True)])
    heads = ("criterion", "signal", "unit", "least", "5 %", "50 %", "95 %", "greatest")
    covered = [(v.criterion, v.signal, v.unit, *map(number, [*v.values()][3:])) for v in r.validity]
    text = "Range of the judged windows: minimum, quantiles and maximum of their samples."
    yield ReportSection("Validity range", [text], [Table(heads, covered)])
    faults = [f"{s['run']}: {s['sentence']}" for s in r.sensors]
    yield ReportSection("Faults of sensors", faults or ["The channels do not contradict each other."])
    yield ReportSection("Limits of the validation", r.not_covered)
    if r.notes:
        yield ReportSection("Notes", r.notes)
    yield _origin(r)
    yield ReportSection("Terms and standing", [r.standing, *r.references])


def _verdict(r: Content) -> ReportSection:
    rows = [
        (
            f"{j.criterion}: {j.requirement}",
            j.outcome + (", with a warning" if j.flags else ""),
            _error(j),
            j.reason,
        )
        for j in r.judgements
    ]
    heads = ("criterion", "verdict", "E ± 2 u_val", "why")
    flags = [f"Warning. {j.criterion}: {flag}" for j in r.judgements for flag in j.flags]
    return ReportSection("Verdict", flags, [Table(heads, rows, words=True)])


def _error(j: Content) -> str:
    """E with its expanded uncertainty."""
    if j.budget is None:
        return NO_VALUE
    unknown = f" or more, {len(j.budget.unknown)} sources not known" if j.budget.unknown else ""
    return f"{number(j.E)} ± {number(j.k_u_val)} {j.unit}{unknown}"


def _judged(r: Content) -> ReportSection:
    rows = []
    for j in r.judgements:
        why = "; ".join(f"{count}: {reason}" for reason, count in j.excluded.items()) or "none"
        runs = f"{len(j.runs)} of {len(r.samples)}: {', '.join(j.runs) or 'none'}"
        rows.append((j.criterion, str(j.offered), why, str(j.windows), runs))
    heads = ("criterion", "windows offered", "excluded", "judged", "runs that count")
    left = dict.fromkeys(f"{n}: {why}" for j in r.judgements for n, why in j.left_out.items())
    stated = [f"{j.criterion}: {'; '.join(j.restrictions)}." for j in r.judgements if j.restrictions]
    stated += [f"Runs that do not count: {'; '.join(left)}."] if left else []
    stated += [f"The same motion, or nearly: {' and '.join(pair)}." for pair in r.same_runs]
    stated += [
        f"{s.run}: {s.samples} samples, of which {s.used} are used, {s.frozen} frozen, {s.dropped} "
        f"dropped, {s.spikes} spikes.{''.join(f' {note}.' for note in s.notes)}"
        for s in r.samples
    ]
    known = ", ".join(f.name for f in r.learned_from)
    stated.append(
        f"The model was learned from: {known}."
        if known
        else "The file of the model does not name its training runs."
    )
    return ReportSection("Judged model and data", stated, [Table(heads, rows, words=True)])


def _errors(r: Content) -> ReportSection:
    rows = [
        (
            j.criterion,
            j.unit,
            *map(number, (j.tolerance, j.E)),
            NO_VALUE if j.E_axes is None else ", ".join(map(number, j.E_axes)),
            *map(number, (j.rms, j.largest)),
            f"{j.windows}, {number(j.independent)} independent",
            f"{number(j.estimate)} ({number(j.low)} to {number(j.high)})",
        )
        for j in r.judgements
    ]
    stated = (
        "E = S − D is predicted minus measured at the horizon, as the mean over windows. For "
        "position it is the mean distance, and the mean error forward and to starboard. Bounds of "
        "the share, or of the RMS, are one-sided at the confidence of the criterion."
    )
    heads = ("criterion", "unit", "tolerance", "E", "forward, starboard", "RMS", "largest", "windows")
    return ReportSection("Comparison error", [stated], [Table((*heads, "share or RMS"), rows)])


def _uncertainty(r: Content) -> ReportSection:
    rows = [
        (
            j.criterion,
            j.unit,
            *(UNKNOWN if j.budget[n] is None else number(j.budget[n]) for n in SOURCES),
        )
        for j in r.judgements
        if j.budget is not None
    ]
    stated = (
        "Standard uncertainties of the judged quantity at the horizon. u_val² = u_num² + u_input² "
        "+ u_D², where u_input² includes initial state, parameters, process noise, current and "
        "wind. Unknown contributions are left out, so u_val is a lower bound. u_num is by "
        "Richardson's extrapolation."
    )
    heads = ("criterion", "unit", *(CALLED.get(name, name) for name in SOURCES))
    return ReportSection("Uncertainty", [stated], [Table(heads, rows)])


def _origin(r: Content) -> ReportSection:
    c = r.criteria
    rows = [
        ("made", f"{r.made}, by the clock of the computer"),
        ("command", r.command),
        ("model", r.model),
        ("code of the model", r.confinement),
        ("ship", r.ship),
        ("criteria", f"{c.path}, last changed {c.modified}, read {c.read}, SHA-256 {c.sha256}"),
        *((f.role, f"{f.path}, SHA-256 {f.sha256}") for f in r.files),
        *((f"samples of {s.run}", f"SHA-256 {s.sha256}") for s in r.samples),
        ("ship, numbers", f"SHA-256 {r.hashes.ship}"),
        ("model, parameters", f"SHA-256 {r.hashes.parameters}"),
        (
            "cybership",
            f"{r.code.version}, revision {r.code.revision or UNKNOWN}, SHA-256 {r.code.sha256}",
        ),
        (
            "libraries",
            ", ".join(f"{name} {v}" for name, v in [*r.versions.items(), *r.code.libraries.items()]),
        ),
        ("signed", "no" if r.public_key is None else r.public_key),
    ]
    stated = r.fmu["sentences"] if r.fmu else []
    return ReportSection("Made with", stated, [Table(("", ""), rows, words=True)])
