"""The mission in one command: ``cybership demo``.

A ship with more drag than its model sails two paths. From the one the diagnosis finds what the model
lacks, the other puts that to the test. What was found goes into the belief of the controller, and the
ship sails again.
"""

if __name__ == "__main__":
    from cosim.watch import watched

    watched()  # before all other imports, which take a while

import argparse
import time
from importlib.util import find_spec
from pathlib import Path

import cosim
from cosim.command import BAD_INPUT, complain, folder_name, program, run_command
from cosim.results import draw

NEEDED = ("scipy", "jinja2", "pandas")
# What the plant has and its model does not: scenarios/hidden.ssv.
HIDDEN = "hidden.ssv"
SECONDS = 150.0  # of each run; chosen: more than a round of the ellipse, and the demo stays short


def main(arguments: list[str] | None = None) -> int:
    """Run it; returns the exit code."""
    parser = argparse.ArgumentParser(prog=program("cybership.demo"), description=__doc__)
    parser.add_argument("--out", type=folder_name, metavar="DIR", help="result folder (results/demo)")
    options = parser.parse_args(arguments)
    missing = [name for name in NEEDED if find_spec(name) is None]
    if missing:
        complain(f"the demo needs {', '.join(missing)}: pip install 'cybership[diagnosis]'")
        return BAD_INPUT
    begun = time.perf_counter()
    out = options.out or Path("results", "demo")
    try:
        demonstrate(out)
    except cosim.InputError as error:
        complain(error)
        return BAD_INPUT
    print(f"\n{time.perf_counter() - begun:.0f} s; pictures, report.html and model.ssv in {out}")
    return 0


def demonstrate(out: Path) -> None:
    """Sail, diagnose, sail with what was found.

    Args:
        out: for logs, report, model and pictures.

    Raises:
        InputError: nothing can be written there.
    """
    import diagnosis

    hidden = cosim.shipped_folder() / HIDDEN
    print("1. A ship with more drag than its model believes sails an ellipse and an eight.")
    for name in ("ellipse", "eight"):
        _sail(name, out / name, hidden)
    print("2. What does the model lack? Poses and commands alone tell:\n")
    runs = diagnosis.load([out / "ellipse", out / "eight"])
    found = diagnosis.diagnose(runs[:1], held_out=runs[1:])
    print(found)
    found.to_ssv(out / "model.ssv")
    found.write_report(out / "report.html")
    found.plot.where().save(out / "where.png")
    print("\n3. The same controller with its own belief, and with the learned model; neither adapts.")
    beliefs = {"own belief": [], "learned model": [out / "model.ssv"]}
    folders = {label: out / f"ellipse_{label.replace(' ', '_')}" for label in beliefs}
    for label, believe in beliefs.items():
        metrics = _sail("ellipse_bs", folders[label], hidden, believe).metrics
        print(f"   {label}: distance to the target {1e3 * metrics['e_pos_rms']:.0f} mm RMS")
    draw({label: cosim.read_log(folder) for label, folder in folders.items()}, out)


def _sail(name: str, folder: Path, hidden: Path, believe: list[Path] | None = None) -> cosim.Result:
    """A run of a shipped scenario with the hidden drag, with the signals that pictures need.

    Raises:
        InputError: it did not go through.
    """
    settings = {"log.signals": "compact", "stop": SECONDS}
    result = cosim.simulate(name, folder, [hidden], set=settings, believe=believe or [])
    if result.status != "done":
        raise cosim.InputError(f"the run in '{folder}' {result.status}: {result.message}")
    return result


if __name__ == "__main__":
    run_command(main)
