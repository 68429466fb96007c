"""Established methods beside this project's: ``python -m benchmarks.peers DATA``.

Each measured run of CyberShip Enterprise 1 is left out in turn. Every method chooses its settings by
leaving out each of the other runs in turn, learns from all of these, and predicts the run left out in
the project's windows, from the same start states. ``nominal`` is the model that nothing was learned for,
``steady`` a ship that keeps its velocity, ``learn`` this project.
"""

import argparse
import json
import resource
import warnings
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict
from importlib import import_module
from importlib.metadata import version
from math import degrees
from pathlib import Path

import numpy as np
from threadpoolctl import threadpool_limits

import cosim
import diagnosis
from cosim.command import complain, run_command
from diagnosis import Model, WeakWindows
from studies.study_report import Report

from .chosen_settings import SEED, Answer, Method, answer
from .same_windows import Continuous, Held, Law, Nominal

# Module of this folder -> the package that it needs.
PEERS = {
    "narx": "sysidentpy",
    "sindy": "pysindy",
    "kalman_regression": "scipy",
    "neural": "scikit-learn",
}
OURS = ("nominal", "steady", "learn")
STEP = 0.05  # s, of the laws that are not learned

Asked = Callable[[Sequence[WeakWindows], WeakWindows], Answer]


def steady(nu: np.ndarray, given: np.ndarray) -> np.ndarray:
    """No acceleration."""
    return np.zeros_like(nu)


def learn(rest: Sequence[WeakWindows], out: WeakWindows) -> Answer:
    """What ``diagnosis.learn`` says of the run left out."""
    begin = _seconds()
    e = diagnosis.diagnose(rest, [out]).comparison.evaluations[-1].after
    return Answer(e.position, e.heading, _seconds() - begin, {})


def _seconds() -> float:
    """Processor time of this process and of those that it has started [s]."""
    used = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    return sum(u.ru_utime + u.ru_stime for u in used)


def fixed(law: Law) -> Asked:
    """A law that learns nothing."""

    def asked(rest: Sequence[WeakWindows], out: WeakWindows) -> Answer:
        begin = _seconds()
        errors = Held([out.smoothed], out.horizon).errors(law)
        return Answer(*errors, _seconds() - begin, {})

    return asked


def methods(names: Sequence[str], nominal: Nominal) -> Iterator[tuple[str, Asked]]:
    """Those that are installed, by name; says in a line which are not."""
    reference = Continuous(nominal.acceleration, STEP)
    ours = {"nominal": fixed(reference), "steady": fixed(Continuous(steady, STEP)), "learn": learn}
    missing = []
    for name in names:
        if name in ours:
            yield name, ours[name]
            continue
        try:
            module = import_module(f".{name}", __package__)
        except ModuleNotFoundError:
            missing.append(f"{name} ({PEERS[name]})")
            continue
        final = getattr(module, "final", module.fit)
        yield name, _searching(Method(name, module.fit, module.SETTINGS, final), nominal, reference)
    if missing:
        complain(
            f"not installed, left out: {', '.join(missing)}; pip install '.[analysis]' --group peers",
            kind="",
        )


def _searching(method: Method, nominal: Nominal, reference: Law) -> Asked:
    def asked(rest: Sequence[WeakWindows], out: WeakWindows) -> Answer:
        training = [w.smoothed for w in rest]
        return answer(method, training, [out.smoothed], nominal, out.horizon, reference)

    return asked


def rows(folder: Path, runs: Sequence[str]) -> Iterator[list[str]]:
    """Errors by method and run left out, of the answers in a folder.

    Behind them are the geometric means of nominal over own errors, where all runs are there, and the
    processor time for a run left out.
    """
    kept = {name: folder / f"{name}.json" for name in (*OURS, *PEERS)}
    read = {name: json.loads(file.read_text()) for name, file in kept.items() if file.exists()}
    for name, found in read.items():
        answers = {r: Answer(**found[r]) for r in runs if r in found}
        cells = [
            f"{1e3 * a.position:.0f} mm, {degrees(a.heading):.1f}°" if a else "–"
            for a in map(answers.get, runs)
        ]
        falls = ["–", "–"]
        if all(r in read.get("nominal", {}) and r in answers for r in runs):
            nominal = [Answer(**read["nominal"][r]) for r in runs]
            by = [
                (n.position / answers[r].position, n.heading / answers[r].heading)
                for n, r in zip(nominal, runs, strict=True)
            ]
            falls = [f"{x:.2f}x" for x in np.exp(np.mean(np.log(by), axis=0))]
        if answers:
            yield [name, *cells, *falls, f"{np.mean([a.seconds for a in answers.values()]):.3g}"]


def write(folder: Path, runs: Sequence[str]) -> Path:
    """The report of all answers in a folder; its path."""
    report = Report(folder, "Established methods", [SEED])
    packages = sorted({p for n, p in PEERS.items() if (folder / f"{n}.json").exists()})
    report.text(
        """Errors in the project's windows of the run left out of the training data, from the same start
        states; behind them geometric means of nominal over own error, and processor time for a run left
        out [s], search included. """
        f"{', '.join(f'{p} {version(p)}' for p in packages)}."
    )
    report.table(["method", *runs, "position", "heading", "time"], rows(folder, runs))
    return report.write()


def main(arguments: Sequence[str] | None = None) -> int:
    """Command line."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.peers", description=__doc__)
    parser.add_argument("data", type=Path, metavar="DATA", help="folder with *.mat or cse1/*.mat")
    parser.add_argument("--runs", nargs="+", metavar="NAME", help="to use, three or more (all)")
    parser.add_argument("--left-out", nargs="+", metavar="NAME", help="runs left out in turn (all)")
    parser.add_argument(
        "--methods", nargs="+", choices=[*OURS, *PEERS], default=[*OURS, *PEERS], help="to ask (all)"
    )
    parser.add_argument(
        "--out", type=Path, default=Path("results/peers"), help="folder of answers and report"
    )
    options = parser.parse_args(arguments)
    files = sorted(options.data.glob("*.mat")) or sorted((options.data / "cse1").glob("*.mat"))
    chosen = [f for f in files if not options.runs or f.stem in options.runs]
    if len(chosen) < 3:
        raise cosim.InputError(f"{len(chosen)} measured runs in '{options.data}': needs three")
    options.out.mkdir(parents=True, exist_ok=True)
    warnings.simplefilter("ignore")  # of fits that fail, which the search sees
    with threadpool_limits(1):
        runs = diagnosis.gather(chosen)
        for name, asked in methods(options.methods, Nominal(Model(), runs[0].run.commands)):
            file = options.out / f"{name}.json"
            for k, out in enumerate(runs):
                if options.left_out and out.run.name not in options.left_out:
                    continue
                found = asked([*runs[:k], *runs[k + 1 :]], out)
                print(f"{name}, without {out.run.name}: {found}", flush=True)
                kept = json.loads(file.read_text()) if file.exists() else {}
                file.write_text(json.dumps(kept | {out.run.name: asdict(found)}, indent=1) + "\n")
    print(write(options.out, [w.run.name for w in runs]).read_text())
    return 0


if __name__ == "__main__":
    run_command(main)
