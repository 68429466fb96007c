"""The ships: where their runs are, under which licence, and how they are split.

No file of them is part of this project. A split follows from the names of the runs, and the hashes of
the files are checked, so that all entries see the same. The runs of the Otter are simulated.
"""

import hashlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import diagnosis
from cosim import InputError
from diagnosis import Model, WeakWindows
from diagnosis.predictors import ship_with
from diagnosis.runs import read_frame
from studies import low_speed_tanker, research_vessel, tanker
from studies.ship_folds import read

from . import simulated_otter

Runs = tuple[list[WeakWindows], Model]


@dataclass(frozen=True)
class DataSet:
    """One ship's runs.

    Attributes:
        folder: name of the folder with its files.
        files: patterns of their names; none: the runs are simulated.
        source: where to get them.
        licence: of the files.
        digest: SHA-256 of their names and hashes.
        horizons: lengths of the windows [s]; the last is that of the training.
        runs: reads the files.
        folds: how many; each is left out in turn. None: each run.
        train: names of the runs of a published training list, with which all other runs are predicted.
            Those of the same log as one of these are in neither part. Empty: the folds.
    """

    folder: str
    files: tuple[str, ...]
    source: str
    licence: str
    digest: str
    horizons: tuple[float, ...]
    runs: Callable[[Sequence[Path], float], Runs]
    folds: int | None = None
    train: tuple[str, ...] = ()

    def load(self, data: Path) -> Runs:
        """The runs, in the order of their names, and the description of the ship.

        Raises:
            InputError: files are absent, or others than those of the split.
            ModuleNotFoundError: the simulator is not installed.
        """
        if not self.files:
            return self.runs((), self.horizons[-1])
        folder = data / self.folder
        files = sorted(f for pattern in self.files for f in folder.glob(pattern))
        if not files:
            raise InputError(f"no {' or '.join(self.files)} in '{folder}'; get them: {self.source}")
        if digest_of(files) != self.digest:
            raise InputError(f"the files in '{folder}' are not those of the split; {self.source}")
        return self.runs(files, self.horizons[-1])

    def split(self, runs: Sequence[WeakWindows]) -> list[tuple[list[WeakWindows], list[WeakWindows]]]:
        """Training runs and runs left out, of each fold; those of one log are never in both."""
        log = [low_speed_tanker.log_of(w.run.name) for w in runs]
        if self.train:
            known = [w for w in runs if w.run.name in self.train]
            logs = {low_speed_tanker.log_of(w.run.name) for w in known}
            return [(known, [w for w, of in zip(runs, log, strict=True) if of not in logs])]
        count = self.folds or len({*log})
        fold = [[*dict.fromkeys(log)].index(of) % count for of in log]
        return [
            (
                [w for w, k in zip(runs, fold, strict=True) if k != i],
                [w for w, k in zip(runs, fold, strict=True) if k == i],
            )
            for i in range(count)
        ]


def digest_of(files: Sequence[Path]) -> str:
    """SHA-256 of the names and the hashes of files."""
    whole = hashlib.sha256()
    for f in sorted(files, key=lambda f: f.name):
        whole.update(f"{f.name} {hashlib.sha256(f.read_bytes()).hexdigest()}\n".encode())
    return whole.hexdigest()


def _cse1(files: Sequence[Path], horizon: float) -> Runs:
    return diagnosis.gather(files, horizon=horizon), Model()


def _by_columns(ship: str, columns: dict[str, tuple[str, float]]) -> Callable[..., Runs]:
    def runs(files: Sequence[Path], horizon: float) -> Runs:
        model = Model(ship=ship_with((), ship))
        found = [read(f, columns, model) for f in files]
        return diagnosis.gather(found, model=model, anyway=True, horizon=horizon), model

    return runs


def _gunnerus(files: Sequence[Path], horizon: float) -> Runs:
    parts, model, _ = research_vessel.manoeuvres(files[0].parent)
    return diagnosis.gather(parts, model=model, anyway=True, horizon=horizon), model


def _otter(_: Sequence[Path], horizon: float) -> Runs:
    model = Model(ship=ship_with((), "otter"))
    found = [read_frame(log, name, model.ship) for name, log in simulated_otter.simulated()]
    return diagnosis.gather(found, model=model, horizon=horizon), model


_ESSO_OSAKA = DataSet(
    "esso_osaka",
    tuple(f"{kind}_*.csv" for kind in low_speed_tanker.KINDS),
    "NAOE-5thLab/FRT-DS-ESSO, without the eight test runs of both publications",
    "CC BY-NC 4.0",
    "4fc99febc2e32180fbf40ed1e773bfe8587a2e5d2128ecac636b03cedf425da6",
    low_speed_tanker.HORIZONS,
    _by_columns("esso_osaka", low_speed_tanker.COLUMNS),
    4,
)

DATASETS = {
    "cse1": DataSet(
        "cse1",
        ("*.mat",),
        "NTNU's public archive of CyberShip Enterprise 1, see docs/real_ship.md",
        "MIT",
        "23824f90592a90505c19e9a89596273c6ff77a5694a711fa7a6d0b5e4db2c5f6",
        (8.0,),
        _cse1,
    ),
    "kvlcc2": DataSet(
        "kvlcc2_hsva",
        ("z_*.csv",),
        "HSVA for SIMMAN, in the repository of M. Alexandersson's thesis (2022)",
        "MIT",
        "e6cf391f3c5a4eb23e9c5326f487dc3ddc7587038f7987cd7e70c8f0b3b40f69",
        (20.0,),
        _by_columns("kvlcc2", tanker.COLUMNS),
        3,
    ),
    "gunnerus": DataSet(
        "gunnerus",
        ("trial_1.csv", "trial_2.csv"),
        "RVG_ManeuveringTests.csv of NTNU-MCS/MCSim_python (b7b6534), 0 to 4140 and 5250 to 8230 s",
        "GPL-3.0-or-later",
        "af9a8bd9e1c190ab2a3181b8fe019badee2b06535356ad2c25865fda8ebef83f",
        (60.0,),
        _gunnerus,
        3,
    ),
    "otter": DataSet(
        "",
        (),
        f"simulated by T. I. Fossen's Python Vehicle Simulator ({simulated_otter.INSTALLED_BY}), "
        f"{simulated_otter.WHAT}",
        "MIT",
        "",
        (10.0,),
        _otter,
        3,
    ),
    "esso_osaka": _ESSO_OSAKA,
    # Train-TZRB of Wakita et al. (2022): one of its eight, cut from a turn, is not in the files.
    "esso_osaka_tzrb": replace(
        _ESSO_OSAKA,
        source=f"{_ESSO_OSAKA.source}; training list Train-TZRB of Wakita et al. (2022)",
        train=(
            "random_06-Aug-2020_16_24_25_4",
            "random_06-Aug-2020_16_24_25_6",
            "turn_14-Sep-2020_15_58_08",
            "zigzag_31-Jul-2020_13_22_52",
            "zigzag_31-Jul-2020_13_50_28",
            "berthing_12-Nov-2020_11_14_47",
            "berthing_12-Nov-2020_13_37_05",
        ),
    ),
}
