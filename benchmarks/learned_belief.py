"""What a learned model buys a controller: ``python -m benchmarks.learned_belief [--seeds N]``.

The ship of ``scenarios/hidden.ssv`` has more surge drag than its model. The diagnosis learns it from two
runs with seeds that no row of the table has. Each row is the ellipse with one controller and one belief.
"""

import argparse
from collections.abc import Iterator, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

import cosim
import diagnosis

HIDDEN = cosim.shipped_folder() / "hidden.ssv"
TRAINING = (("ellipse", 1001), ("rich", 1002))  # scenario and seed


def learn(folder: Path) -> Path:
    """Learn the model from two runs; its file."""
    runs = []
    for name, seed in TRAINING:
        sailed(name, folder / name, seed)
        runs.append(folder / name)
    found = diagnosis.diagnose(diagnosis.load(runs))
    print(found)
    return found.to_ssv(folder / "model.ssv")


def sailed(
    name: str, folder: Path, seed: int, believe: Sequence[Path] = (), **settings: object
) -> float:
    """Distance to the target [m], root mean square, of a run of the ship with the hidden drag."""
    wanted = {"log.signals": "compact", **settings}
    result = cosim.simulate(name, folder, [HIDDEN], seed=seed, set=wanted, controller_model=believe)
    return result.metrics["e_pos_rms"]


def rows(folder: Path) -> Iterator[tuple[str, str, list[Path]]]:
    """Description, scenario and beliefs of each row."""
    nominal = folder / "nominal.ssv"
    # One nominal value is enough: of all others the plant's own start values are believed.
    cosim.write_parameters(nominal, cosim.ParameterSet({"vessel": {"X_u": cosim.Parameter(-0.6555)}}))
    learned = learn(folder)
    yield "as the thesis has it: no damping by the yaw rate, (2.27)", "ellipse_bs", []
    yield "the nominal model", "ellipse_bs", [nominal]
    yield "the learned model", "ellipse_bs", [learned]
    yield "as the thesis has it, with adaptation", "ellipse", []
    yield "the nominal model, with adaptation", "ellipse", [nominal]
    yield "the learned model, with adaptation", "ellipse", [learned]


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=5, metavar="N", help="runs of each row (5)")
    seeds = range(1, parser.parse_args().seeds + 1)
    with TemporaryDirectory() as scratch:
        folder = Path(scratch)
        print("| controller model | median [mm] | lowest | highest |\n|---|--:|--:|--:|")
        for text, name, believe in rows(folder):
            errors = [1e3 * sailed(name, folder / "run", seed, believe) for seed in seeds]
            low, middle, high = np.quantile(errors, [0.0, 0.5, 1.0])
            print(f"| {text} | {middle:.0f} | {low:.0f} | {high:.0f} |", flush=True)


if __name__ == "__main__":
    main()
