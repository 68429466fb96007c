"""The report of a record as sections with tables, for the page and for the PDF alike."""

from collections.abc import Iterator

from ..report.content import Content
from ..report.document import ReportSection, Table
from ..report.formatting import NO_VALUE, number

BUDGET = ("u_D", "initial_state", "parameters", "process_noise", "u_input", "u_num", "u_val")
CALLED = {"u_D": "measurement u_D", "initial_state": "initial state", "process_noise": "process noise"}


def sections(r: Content) -> Iterator[ReportSection]:
    """The report, in order."""
    told = [(f"{j.criterion}: {j.requirement}", j.outcome, j.reason) for j in r.judgements]
    yield ReportSection("Verdict", tables=[Table(("criterion", "verdict", "why"), told, words=True)])
    yield _errors(r)
    yield _uncertainty(r)
    heads = ("signal", "unit", "least", "5 %", "50 %", "95 %", "greatest")
    covered = [(v.signal, v.unit, *map(number, [*v.values()][2:])) for v in r.validity]
    text = "What the data cover: least, quantiles and greatest over all samples that are used."
    yield ReportSection("Validity range", [text], [Table(heads, covered)])
    faults = [f"{s['run']}: {s['sentence']}" for s in r.sensors]
    yield ReportSection("Faults of sensors", faults or ["The channels do not contradict each other."])
    yield ReportSection("What is not covered", r.not_covered)
    if r.notes:
        yield ReportSection("Notes", r.notes)
    yield _origin(r)
    yield ReportSection("Terms and standing", [r.standing, *r.references])


def _errors(r: Content) -> ReportSection:
    rows = [
        (
            j.criterion,
            j.unit,
            *map(number, (j.tolerance, j.E, j.rms, j.largest)),
            f"{j.windows}, {number(j.independent)} independent",
            f"{number(j.estimate)} ({number(j.low)} to {number(j.high)})",
        )
        for j in r.judgements
    ]
    told = (
        "E is measured minus predicted at the horizon, of position the distance, its mean over windows. "
        "Bounds of the share, or of the RMS, are one-sided at the confidence of the criterion."
    )
    heads = ("criterion", "unit", "tolerance", "E", "RMS", "largest", "windows", "share or RMS")
    return ReportSection("Comparison error", [told], [Table(heads, rows)])


def _uncertainty(r: Content) -> ReportSection:
    rows = [
        (
            j.criterion,
            j.unit,
            *("not known" if j.budget[n] is None else number(j.budget[n]) for n in BUDGET),
        )
        for j in r.judgements
        if j.budget is not None
    ]
    told = (
        "Standard uncertainties of the judged quantity at the horizon; u_input² is that of initial "
        "state, parameters and process noise, u_val² = u_num² + u_input² + u_D², of what is known."
    )
    heads = ("criterion", "unit", *(CALLED.get(name, name) for name in BUDGET))
    return ReportSection("Uncertainty", [told], [Table(heads, rows)])


def _origin(r: Content) -> ReportSection:
    c = r.criteria
    rows = [
        ("made", r.made),
        ("command", r.command),
        ("model", r.model),
        ("ship", r.ship),
        ("criteria", f"{c.path}, last changed {c.modified}, read {c.read}, SHA-256 {c.sha256}"),
        *((f.role, f"{f.path}, SHA-256 {f.sha256 or NO_VALUE}") for f in r.files),
        ("versions", ", ".join(f"{name} {v}" for name, v in r.versions.items())),
        ("signed", "no" if r.public_key is None else r.public_key),
    ]
    purpose = [f"Purpose: {c.purpose}."] if c.purpose else []
    told = r.fmu["sentences"] if r.fmu else []
    return ReportSection("Made with", [*purpose, *told], [Table(("", ""), rows, words=True)])
