"""The mission in one command: ``cybership demo``.

A ship with more drag than its model runs an ellipse and an eight. The diagnosis finds the missing effect
from the ellipse, and tests it on the eight. Then the ship runs with the nominal model in its controller,
and with the learned model.
"""

if __name__ == "__main__":
    from cosim.supervision import supervised

    supervised()  # before all other imports, which take a while

import argparse
import time
from importlib.util import find_spec
from pathlib import Path

import cosim
from cosim.command import BAD_INPUT, complain, folder_name, program, run_command
from cosim.results import draw, read_options

NEEDED = ("scipy", "jinja2", "pandas")
# What the plant has and its model does not: scenarios/hidden.ssv.
HIDDEN = "hidden.ssv"
DPI = 200  # of eight.png, which docs/images has; chosen
SECONDS = 150.0  # on the ellipse; chosen: three rounds, and the demo stays short


def main(arguments: list[str] | None = None) -> int:
    """Run it; returns the exit code."""
    parser = argparse.ArgumentParser(prog=program("cybership.demo"), description=__doc__)
    parser.add_argument(
        "--out", type=folder_name, metavar="DIR", help="result folder (default: results/demo)"
    )
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
    print("1. A ship with 2 N.s/m more drag than its model runs an ellipse and an eight.")
    _sail("ellipse", out / "ellipse", hidden, stop=SECONDS)
    _sail("eight", out / "eight", hidden)
    print("2. Which effect does the model lack? The diagnosis uses poses and commands only:\n")
    runs = diagnosis.load([out / "ellipse", out / "eight"])
    found = diagnosis.diagnose(runs[:1], held_out=runs[1:])
    print(found)
    found.to_ssv(out / "model.ssv")
    found.write_report(out / "report.html")
    found.plot.where().save(out / "where.png")
    picture = found.plot.free()  # of the eight, from which nothing was learned
    picture.figure.set_facecolor("white")
    picture.save(out / "eight.png", DPI)
    print(
        "\n3. The same controller, with the nominal and with the learned controller model; it "
        "does not adapt."
    )
    nominal = out / "nominal.ssv"
    # One nominal value is enough: of all others the plant's own start values hold in the controller.
    drag = cosim.Parameter(found.start.value("X_u"))
    cosim.write_parameters(nominal, cosim.ParameterSet({"vessel": {"X_u": drag}}))
    models = {"nominal model": nominal, "learned model": out / "model.ssv"}
    folders = {label: out / f"ellipse_{label.replace(' ', '_')}" for label in models}
    for label, controller_model in models.items():
        metrics = _sail("ellipse_bs", folders[label], hidden, controller_model, SECONDS).metrics
        print(f"   {label}: distance to the target {1e3 * metrics['e_pos_rms']:.0f} mm RMS")
    stated = {label: read_options(folder) for label, folder in folders.items()}
    draw({label: cosim.read_log(folder) for label, folder in folders.items()}, out, stated)


def _sail(
    name: str,
    folder: Path,
    hidden: Path,
    controller_model: Path | None = None,
    stop: float | None = None,
) -> cosim.Result:
    """A run of a shipped scenario with the hidden drag, to its end or to another one [s].

    Raises:
        InputError: it did not go through.
    """
    given = [] if controller_model is None else [controller_model]
    result = cosim.simulate(name, folder, [hidden], stop=stop, log="compact", controller_model=given)
    if result.status != "done":
        raise cosim.InputError(f"the run in '{folder}' {result.status}: {result.message}")
    return result


if __name__ == "__main__":
    run_command(main)
