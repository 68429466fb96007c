"""Do intervals of fitted values, and bands about predictions, hold what they say?

``python -m benchmarks.calibration`` fits ships of the kind ``process noise`` of
``benchmarks.hidden_effects`` as the end of ``learn`` does, with the hidden effect known: so it takes ten
seconds a ship, and what the search may get wrong is left out. Nominal coefficients are off by the
prior's standard deviation. It tells of all 95 % intervals how many hold the true value, how far damping
is off, and which share of the samples of windows of a held-out run lies within the bands, positions and
headings alike.

With ``--ship`` bands of the four published runs of CyberShip Enterprise 1 are reported, too, each
predicted with what ``learn`` finds in the three others; with ``--answers DIR`` those of the cells that
``benchmarks.hidden_effects`` has answered. Intervals of shares are binomial, of as many windows, as
samples of one window miss together.
"""

import argparse
import json
import os
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from diagnosis import Model, clean, diagnose, evaluate, load, smooth, weak_windows
from diagnosis.predictors import LEVELS
from diagnosis.search.candidates import model_error
from diagnosis.search.prediction_fit.fit import Fitted, PredictionFit, fit_to, shootings
from diagnosis.search.prediction_fit.joint_posterior import JointPosterior
from diagnosis.search.prediction_fit.refit import fit_model_error, prediction_bands
from diagnosis.search.prior import NominalPrior
from diagnosis.search.refinement import RefinedModel
from fmus.ship import ship

from .hidden_effects.__main__ import PROBLEMS
from .hidden_effects.answers import window_shares, within_bands
from .hidden_effects.cells import cells
from .hidden_effects.problems import Problem, kept, make
from .hidden_effects.reliability_diagram import interval, mean_and_error
from .hidden_effects.scoring import off_by

RUNS = ("random_run1", "run1", "dptest1", "dptest3")  # of CyberShip Enterprise 1


@dataclass
class Found:
    """What was counted.

    Attributes:
        inside: of each interval whether it holds the true value.
        damping: how many standard deviations X_u, Y_v and N_r are off, mean of each ship: motion tells
            force over mass, so that those of one ship are off together.
        shares: for each band the share within it of each window.
    """

    inside: list[bool] = field(default_factory=list)
    damping: list[float] = field(default_factory=list)
    shares: tuple[list[float], ...] = ([], [])

    def add(self, shares: Sequence[Sequence[float]]) -> None:
        """Further windows."""
        for mine, some in zip(self.shares, shares, strict=True):
            mine.extend(some)

    def rows(self, name: str) -> list[str]:
        """Rows of a table in Markdown."""
        found = []
        if self.inside:
            found.append(f"| {name}: 95 % intervals that hold the truth | {_share(self.inside)} |")
            mean = "{:.2f} ± {:.2f} standard deviations".format(*mean_and_error(self.damping))
            found.append(f"| {name}: damping X_u, Y_v, N_r is off by, mean | {mean} |")
        for level, each in zip(LEVELS, self.shares, strict=True):
            if each:
                found.append(f"| {name}: windows within {100 * level:.0f} % | {_share(each)} |")
        return found


def _share(each: Sequence[float]) -> str:
    inside, count = float(np.sum(each)), len(each)
    low, high = interval(round(inside), count)
    return f"{100 * inside / count:.1f} % of {count} ({100 * low:.0f}-{100 * high:.0f} %)"


def fitted(problem: Problem) -> tuple[Fitted, NominalPrior, list]:
    """The fit to predictions of the training runs of a problem, its prior, and all runs."""
    runs = [weak_windows(smooth(clean(run))) for run in problem.runs]
    train = runs[:-1]
    names = [n for d in problem.hidden if d.values for n in ship().effects[d.plain].coefficients]
    prior = NominalPrior.of(Model(), problem.prior)
    at = RefinedModel(
        Model(), np.zeros(prior.size), dict.fromkeys(names, 0.0), np.zeros((len(names),) * 2)
    )
    for _ in range(2):  # the second time with what the first leaves as noise
        sigma = np.sqrt(np.mean(model_error(train, at.model(prior)) ** 2, axis=0))
        at, _ = fit_model_error(at, sigma, train, prior)
    return fit_to(PredictionFit(train, shootings(train, at.model(prior)), at, prior), at), prior, runs


def simulated(seeds: Sequence[int], noise: str, folder: Path) -> Found:
    """Ships in process noise."""
    found, todo = Found(), list(cells(["process noise"], [], [noise], [True], seeds))
    for _ in make(todo, folder):
        pass
    for cell in todo:
        problem = kept(cell.key, folder)
        if problem.note:
            continue
        fit, prior, runs = fitted(problem)
        posterior, model = JointPosterior.of(fit, prior), fit.estimate.model(prior)
        names = [n.partition(".")[2] for n in posterior.names]
        held, damping = off_by(problem, names, posterior.mean, posterior.covariance)
        found.inside += held
        found.damping.append(float(np.mean(damping)))
        (e,) = evaluate(runs[-1:], Model(), model).evaluations
        bands = prediction_bands(e.smoothed, e.windows, model, posterior, fit.disturbance)
        if bands is not None:
            found.add(window_shares(bands, e.after.residuals))
        print(f"{cell.name}, seed {cell.seed}: {sum(held)} of {len(held)}", flush=True)
    return found


def measured(folder: Path) -> Found:
    """Each run of the ship, predicted with what the three others teach."""
    found = Found()
    for name in RUNS:
        files = [folder / f"{other}.mat" for other in (*(n for n in RUNS if n != name), name)]
        *train, last = load(files)
        found.add(within_bands(diagnose(train, [last]).comparison))
    return found


def answered(folder: Path) -> Found:
    """Held-out runs of cells that were answered."""
    found = Found()
    for path in sorted(folder.glob("*.json")):
        shares = json.loads(path.read_text(encoding="utf-8")).get("bands")
        found.add(shares or ([], []))
    return found


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.calibration", description=__doc__)
    parser.add_argument("--seeds", type=int, default=3, metavar="N", help="of six ships each (3)")
    parser.add_argument("--first", type=int, default=0, metavar="SEED", help="of these (0)")
    parser.add_argument("--noise", default="n4", help="of the measurement (n4)")
    parser.add_argument("--problems", type=Path, default=PROBLEMS, metavar="DIR", help=f"({PROBLEMS})")
    parser.add_argument("--answers", type=Path, metavar="DIR", help="of the benchmark")
    parser.add_argument("--ship", action="store_true", help="the measured ship, half an hour")
    options = parser.parse_args()
    seeds = range(options.first, options.first + options.seeds)
    rows = simulated(seeds, options.noise, options.problems).rows("process noise")
    if options.answers:
        rows += answered(options.answers).rows("hidden effects")
    if options.ship:
        rows += measured(Path(os.environ["CYBERSHIP_DATA"]) / "cse1").rows("the ship")
    print("\n".join(["| | |", "|---|--:|", *rows]))


if __name__ == "__main__":
    main()
