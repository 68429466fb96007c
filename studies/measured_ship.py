"""What the thesis' model lacks of the real ship: ``python -m studies.measured_ship DATA``.

Each of the measured runs is left out in turn, the model learns from the others, and is evaluated on the
one left out. The thrust curve learned from all runs is compared with bollard pulls, which are not
among the training data.
"""

from collections.abc import Sequence
from functools import partial
from pathlib import Path

from rich.console import Console

import cosim
import diagnosis
from diagnosis import Diagnosis, Model, WeakWindows, diagnosis_content
from diagnosis.execution.progress import Advance, progress
from diagnosis.search import shares

from .measured import bollard, ship_tables
from .measured.data_folder import measured_files
from .measured.leave_one_out import LeftOutRun, gather, leave_out
from .study_command import run_study, study_parser
from .study_report import Report

# Profiles of the model error over all covariates: a megabyte that the reports of single runs have.
LEFT_OUT = {"where", "where_after"}


def learned(
    runs: Sequence[WeakWindows], prior: float | None, quick: bool, advance: Advance
) -> list[LeftOutRun]:
    """Each run left out in turn; the first alone for a first look."""

    def without(name: str) -> Advance:
        return lambda what: advance(f"without {name}: {what}")

    chosen = runs[:1] if quick else runs
    return [leave_out(runs, k, prior, without(w.run.name)) for k, w in enumerate(chosen)]


def with_all(folds: Sequence[LeftOutRun], found: Diagnosis) -> list[LeftOutRun]:
    """The folds with the errors on their run when it is among the training runs."""
    seen = {e.name: e for e in found.comparison.evaluations}
    return [LeftOutRun(f.found, seen[f.name]) for f in folds]


def study(data: Path, out: Path, prior: float | None, quick: bool) -> Path:
    """Learn from the measured runs and write the report; returns its path."""
    pulls, files = bollard.read(data), measured_files(data)
    with progress(Console(stderr=True)) as advance:
        runs = gather(files, advance)
        folds = learned(runs, prior, quick, advance)
        last = diagnosis.diagnose(runs, (), prior, advance=lambda what: advance(f"all runs: {what}"))
    folds = with_all(folds, last)
    try:
        report = Report(out, "The real ship")
    except OSError as error:
        raise cosim.InputError(f"cannot write to '{out}': {error.strerror}") from None
    share = shares(Model().ship, prior)
    option = "" if prior is None else f" --prior {prior:g}"
    names = ", ".join(w.run.name for w in runs)
    report.text(
        f"NTNU's measured runs of CyberShip Enterprise 1: {names}. Each is left out in turn; the "
        f"missing effects are learned from the others, as by `python -m diagnosis.learn{option}`. "
        f"The prior standard deviation of the mass is {share['m']:.0%}, of thrusts "
        f"{share['plant_F_vsp']:.0%}, of damping from tow tests {share['X_u']:.0%} and from "
        f"another ship {share['N_r']:.0%}; none exceeds a tenth in the search for missing effects."
    )
    ship_tables.write_falls(report, folds)
    ship_tables.write_windows(report, folds)
    ship_tables.write_expected(report, folds)
    ship_tables.write_curve(report, folds, last.learned.model, pulls)
    for f in folds:
        ship_tables.write_findings(report, f"Learned without {f.name}", f.content)
        caption = f"{f.name}: the model error, before and after; the run is not in the training data."
        report.figure(f"omega_{f.name}", ship_tables.model_error_picture(f.evaluation), caption)
    everything = diagnosis_content(last, None, [])
    ship_tables.write_findings(report, "Learned from all runs", everything)
    contents = {f"without {f.name}": f.content for f in folds} | {"all runs": everything}
    kept = {n: {k: v for k, v in c.items() if k not in LEFT_OUT} for n, c in contents.items()}
    report.result("diagnoses", kept)
    report.result("prior", prior)
    return report.write()


def main(arguments: Sequence[str] | None = None) -> None:
    """Command line."""
    parser = study_parser(
        "studies.measured_ship",
        "Learn the missing effects of the real ship, with each measured run left out in turn.",
        "  python -m studies.measured_ship ~/data\n"
        "  python -m studies.measured_ship ~/data --prior 0.1 --out results/careful\n"
        "  python -m studies.measured_ship ~/data --quick",
        seeds=None,
        jobs=False,
    )
    parser.add_argument(
        "data",
        type=Path,
        metavar="DATA",
        help="folder with cse1/*.mat, measured runs, and cse1_static/*.csv, bollard pulls",
    )
    parser.add_argument(
        "--prior",
        type=float,
        metavar="SHARE",
        help="relative standard deviation of every damping coefficient (default: by the source of each "
        "value)",
    )
    options = parser.parse_args(arguments)
    run_study(partial(study, options.data, options.out, options.prior, options.quick))


if __name__ == "__main__":
    main()
