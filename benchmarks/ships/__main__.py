"""Methods on measured and simulated ships: ``python -m benchmarks.ships DATA``.

DATA has a folder for each data set (``--datasets``). The runs of each fold are left out in turn. Every
method learns from all others and predicts these in the same windows, from the same start states. An
installed package adds a method by an entry point of the group ``cybership.methods``.
"""

import argparse
import json
import resource
import warnings
from collections.abc import Iterator, Mapping, Sequence
from importlib import import_module
from importlib.metadata import PackageNotFoundError, entry_points, version
from math import degrees
from pathlib import Path
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np
from threadpoolctl import threadpool_limits

import cosim
from cosim.command import BAD_INPUT, complain, run_command
from cosim.errors import nearest
from diagnosis import Windows
from studies.study_report import RESULTS, Report

from .chosen_settings import SEED
from .datasets import DATASETS, DataSet, Runs
from .entry_predictor import Entry, Score, Training, score, spread

GROUP = "cybership.methods"
# Own entries, each with the package that it needs beside the project's.
OWN = {
    "nominal": "",
    "steady": "",
    "calibrated": "",
    "learned": "",
    "ridge": "",
    "narx": "sysidentpy",
    "sindy": "pysindy",
    "kalman_regression": "",
    "neural": "scikit-learn",
}

SAME = 0.01  # 1, by which an error may differ in another environment
PROJECT = ("calibrated", "learned")  # methods of this project; nominal is what all begin with


def entry(name: str) -> Entry | None:
    """The entry of a name; None: it needs a package that is not installed.

    Raises:
        InputError: there is none.
    """
    if name in OWN:
        try:
            return import_module(f".entries.{name}", __package__).fit
        except ModuleNotFoundError:
            complain(f"'{name}' is left out: it needs {OWN[name]}", kind="")
            return None
    found = entry_points(group=GROUP, name=name)
    if not found:
        known = [*OWN, *(e.name for e in entry_points(group=GROUP))]
        raise cosim.InputError(f"no entry '{name}'{nearest(name, known)}")
    return next(iter(found)).load().fit


def seconds() -> float:
    """Processor time of this process and of those that it has started [s]."""
    used = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    return sum(u.ru_utime + u.ru_stime for u in used)


def answers(data: DataSet, loaded: Runs, fit: Entry) -> Iterator[tuple[str, list[Score], float]]:
    """Of each run, left out with its fold: its scores by horizon, and the time of the fit [s]."""
    runs, model = loaded
    for rest, out in data.split(runs):
        begin = seconds()
        predictor = fit(Training(rest, model, data.horizons[-1]))
        took = seconds() - begin
        usual = [spread(predictor, [*_windows(rest, h)]) for h in data.horizons]
        for w in out:
            scores = [
                score(predictor, own, std)
                for h, std in zip(data.horizons, usual, strict=True)
                for own in _windows([w], h)
            ]
            yield w.run.name, scores, took


def _windows(runs: Sequence, horizon: float) -> Iterator[Windows]:
    """The windows of each run that has some."""
    for w in runs:
        try:
            yield Windows([w.smoothed], horizon)
        except cosim.InputError:
            continue


class Means(NamedTuple):
    """Of a method: means over the runs in windows of a horizon, of errors geometric ones.

    Attributes:
        runs: number of them.
        position, heading: [m], [rad].
        likelihood, inside: see :class:`.entry_predictor.Score`.
        seconds: of a fit.
    """

    runs: int
    position: float
    heading: float
    likelihood: float
    inside: float
    seconds: float


def means(folder: Path, horizon: int) -> dict[str, Means]:
    """By method, of all answers in a folder."""
    read = {f.stem: json.loads(f.read_text()) for f in sorted(folder.glob("*.json"))}
    found = {}
    for name, answer in read.items():
        scored = [r for r in answer.values() if len(r["scores"]) > horizon]
        if not scored:
            continue
        scores = np.array([r["scores"][horizon] for r in scored])
        errors = np.exp(np.mean(np.log(scores[:, :2]), axis=0))
        took = float(np.mean([r["seconds"] for r in scored]))
        found[name] = Means(len(scored), *errors.tolist(), *scores[:, 2:].mean(axis=0).tolist(), took)
    return found


def rows(found: Mapping[str, Means]) -> Iterator[list[str]]:
    """The table of one data set in windows of one horizon, by the means of its methods."""
    nominal = found.get("nominal")
    for name, m in found.items():
        falls = ["–", "–"]
        if nominal is not None and nominal.runs == m.runs:
            falls = [f"{nominal.position / m.position:.2f}x", f"{nominal.heading / m.heading:.2f}x"]
        cells = [f"{m.position:.3g}", f"{degrees(m.heading):.3g}", *falls]
        yield [
            name,
            str(m.runs),
            *cells,
            f"{m.likelihood:.3g}",
            f"{100 * m.inside:.0f}",
            f"{m.seconds:.3g}",
        ]


def lost(found: Mapping[str, Means]) -> Iterator[tuple[str, str, str]]:
    """Position or heading, this project's best method, and those that have a smaller error."""
    for quantity in ("position", "heading"):
        errors = {name: getattr(m, quantity) for name, m in found.items()}
        own = {name: error for name, error in errors.items() if name in PROJECT}
        if own:
            best = min(own, key=lambda name: own[name])
            better = [n for n, e in errors.items() if n not in PROJECT and e < own[best]]
            if better:
                yield quantity, best, ", ".join(better)


def stored_means(file: Path) -> dict[str, Any]:
    """``means`` of a file ``results.json`` beside a page.

    Raises:
        InputError: it has none.
    """
    try:
        return json.loads(file.read_text("utf-8"))["means"]
    except (OSError, ValueError, KeyError) as error:
        raise cosim.InputError(f"no results of this table in '{file}': {error!r}") from None


def differing(earlier: Mapping[str, Any], found: Mapping[str, Any]) -> list[str]:
    """Errors that differ by more than ``SAME`` from those of an earlier page, a line each.

    Args:
        earlier, found: ``means`` of two files ``results.json``; what one alone has is not compared.

    Raises:
        InputError: they have nothing in common.
    """
    lines, compared = [], 0
    for table in [t for t in found if t in earlier]:
        for method in [m for m in found[table] if m in earlier[table]]:
            for quantity in ("position", "heading"):
                before, after = (x[table][method][quantity] for x in (earlier, found))
                compared += 1
                if not abs(after / before - 1.0) <= SAME:
                    lines.append(f"{table}, {method}: {quantity} {after:.4g} in place of {before:.4g}")
    if not compared:
        raise cosim.InputError("the two pages have no method on the same data in common")
    return lines


def of_all(folder: Path, kept: Mapping[str, Any]) -> dict[str, dict[str, Means]]:
    """Data set and horizon -> method -> means, of all answers in a folder and of an earlier page.

    Args:
        folder: of the answers.
        kept: ``means`` of the file ``results.json`` of an earlier page, for what has no answer here.
    """
    found = {}
    for name, data in DATASETS.items():
        for k, horizon in enumerate(data.horizons):
            title = f"{name}, {horizon:g} s"
            before = {method: Means(**each) for method, each in kept.get(title, {}).items()}
            if now := before | means(folder / name, k):
                found[title] = dict(sorted(now.items(), key=lambda item: [*OWN, item[0]].index(item[0])))
    return found


def write(folder: Path, kept: Mapping[str, Any] = MappingProxyType({})) -> Path:
    """The report of all answers in a folder, and of an earlier page, see :func:`of_all`; its path."""
    report, found = Report(folder, "Methods on ships", [SEED]), of_all(folder, kept)
    stated = [[title, *each] for title, methods in found.items() for each in lost(methods)]
    if stated:
        report.text("Here other methods have a smaller error than the best one of this project.")
        report.table(["data", "error", "best of this project", "smaller error"], stated)
    packages = {p for p in ("sysidentpy", "pysindy", "scikit-learn") if _version(p)}
    report.text(
        """Errors in windows of runs that were left out of the training: geometric means over the runs,
        and of the errors of the nominal model over own ones. NLL: negative log likelihood of the poses,
        mean over the samples. Inside: positions and headings inside the bands of 90 %. Time: of the
        processor for a fit, search included. A method that states no uncertainty has that of its errors
        in training. """
        f"{', '.join(f'{p} {_version(p)}' for p in sorted(packages))}."
    )
    report.result("means", {t: {m: x._asdict() for m, x in of.items()} for t, of in found.items()})
    head = ["method", "runs", "position [m]", "heading [°]", "position", "heading", "NLL", "inside [%]"]
    for title, methods in found.items():
        data = DATASETS[title.partition(",")[0]]
        report.heading(title)
        report.text(f"Data: {data.source}. Licence: {data.licence}.")
        report.table([*head, "time [s]"], rows(methods))
    return report.write()


def _version(package: str) -> str:
    try:
        return version(package)
    except PackageNotFoundError:
        return ""


def main(arguments: Sequence[str] | None = None) -> int:
    """Command line."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.ships", description=__doc__)
    parser.add_argument("data", type=Path, metavar="DATA", help="folder with a folder for each data set")
    parser.add_argument("--datasets", nargs="+", choices=[*DATASETS], default=[*DATASETS], help="(all)")
    parser.add_argument(
        "--methods", nargs="+", default=[*OWN], metavar="NAME", help="entries (own ones)"
    )
    parser.add_argument(
        "--out", type=Path, default=Path("results/ships"), help="folder of answers and report"
    )
    parser.add_argument(
        "--compare",
        type=Path,
        metavar="FILE",
        help="results.json of an earlier page: exit code 1 if an error differs by more than 1 %%",
    )
    parser.add_argument(
        "--keep",
        type=Path,
        metavar="FILE",
        help="results.json of an earlier page: what is not run now stays in the table",
    )
    try:
        return _table(parser.parse_args(arguments))
    except cosim.InputError as error:
        complain(str(error))
        return BAD_INPUT


def _table(options: argparse.Namespace) -> int:
    """Run the methods, write the page, compare it; returns the exit code."""
    kept = stored_means(options.keep) if options.keep else {}
    earlier = stored_means(options.compare) if options.compare else None
    warnings.simplefilter("ignore")  # of fits that fail, which the search sees
    with threadpool_limits(1):
        for dataset in options.datasets:
            folder = options.out / dataset
            try:
                loaded = DATASETS[dataset].load(options.data)
            except ModuleNotFoundError as error:
                complain(f"'{dataset}' is left out: {error}", kind="")
                continue
            folder.mkdir(parents=True, exist_ok=True)
            for name in options.methods:
                if (fit := entry(name)) is None:
                    continue
                found = {}
                for run, scores, took in answers(DATASETS[dataset], loaded, fit):
                    print(f"{dataset}, {name}, without {run}: {scores}", flush=True)
                    found[run] = {"scores": scores, "seconds": took}
                (folder / f"{name}.json").write_text(json.dumps(found, indent=1) + "\n")
    page = write(options.out, kept)
    print(page.read_text())
    if earlier is None:
        return 0
    lines = differing(earlier, stored_means(page.with_name(RESULTS)))
    print("\n".join(lines or [f"all errors are within {SAME:.0%} of '{options.compare}'"]))
    return 1 if lines else 0


if __name__ == "__main__":
    run_command(main)
