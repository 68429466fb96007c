"""The tanker KVLCC2 on its free-running zig-zags: ``python -m studies.tanker DATA``.

DATA is the folder of the files that HSVA measured for the SIMMAN workshops, in the form in which the
repository of M. Alexandersson's thesis (2022) has them: ``z_AA_BB.csv``, with the columns named below.
It is not part of this project.
"""

from pathlib import Path

import numpy as np

import diagnosis
from cosim import InputError
from diagnosis import Model
from diagnosis.execution.progress import silent
from diagnosis.predictors import ship_with
from diagnosis.search import Method

from .ship_folds import folds_command, learn_folds, read, titled, write_folds
from .study_report import Report

# Column of the files -> signal, factor to SI. The angle of the rudder has the opposite sign there.
COLUMNS = {
    "t": ("time", 1.0),
    "x": ("x", 1.0),
    "y": ("y", 1.0),
    "psi_deg": ("psi", np.pi / 180.0),
    "rudder_deg": ("rudder.delta", -np.pi / 180.0),
    "rps": ("propeller.n", 1.0),
    "thrust": ("propeller.thrust", 1.0),
}


def study(data: Path, out: Path, folds: int | None, by: str | Method, quick: bool) -> Path:
    """Learn from the zig-zags, some left out in turn, and write what came out."""
    files = sorted(data.glob("z_*.csv"))
    if not files:
        raise InputError(f"no zig-zags z_*.csv in '{data}'")
    model = Model(ship=ship_with((), "kvlcc2"))
    chosen = files[::4] if quick else files
    runs = diagnosis.gather([read(f, COLUMNS, model) for f in chosen], model=model, anyway=True)
    report = Report(out, titled("KVLCC2, a tanker of 7 m: free-running zig-zags", by))
    report.text(
        f"{len(runs)} zig-zags; the nominal model is that of the MMG standard method "
        f"(`ships/kvlcc2.toml`). Predictions over {runs[0].horizon:.3g} s; model error in windows "
        f"of {runs[0].width:.3g} s. No fit uses the measured thrust."
    )
    write_folds(report, list(learn_folds(runs, folds, model, by, silent)))
    return report.write()


def main() -> None:
    """Command line; leaves with an exit code."""
    folds_command(
        "tanker",
        "Learn the missing effects of KVLCC2 from its zig-zags.",
        "~/kvlcc2_hsva",
        "folder of the files",
        "run",
        study,
    )


if __name__ == "__main__":
    main()
