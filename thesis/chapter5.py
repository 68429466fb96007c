"""The simulations of chapter 5 again: ``python -m thesis.chapter5``.

Four variants of concurrent learning, adaptive backstepping and backstepping follow both paths, over many
seeds of noise and freezes, and once with the ship's true state. Each conclusion of the thesis is held
against the result; where it comes out otherwise, an experiment shows why.
"""

from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

import cosim
from cosim.dispatch import FinishedRun
from studies.study_command import progress, run_study, study_parser
from studies.study_report import Report, records, stored

from .monte_carlo import Content, interval, ratio, run_all, run_each, shipped, vary
from .tracking.outcome import LEARNED_FROM, PHI, TrackingOutcome, columns, outcome, true_states
from .tracking.seed_statements import statements
from .tracking.store_verdicts import store_claims
from .tracking.verdict import CONTROLLERS, FOUR, OLD, PRINTED, claims, goals, short

PATHS = ("ellipse", "eight")
SENSES = ("mdf", "kalman")
NEEDED = [
    "vessel.x",
    "vessel.y",
    "vessel.v",
    "vessel.r",
    "guidance.x_t",
    "guidance.y_t",
    "guidance.psi_t",
    "controller.z1_x",
    "controller.tau_N",
    *LEARNED_FROM,
]
LEARNING = [*PHI, "controller.sigma_min", "controller.rank_met"]
# As printed, a sample may be stored whatever force is commanded, learning takes the force that is asked
# for to be the one that acts, and footnote 1 of 4.1.4 weighs the stored sums.
UNGATED = {"controller.tau_max": 1e6}
# Of the thesis, by path and group of controllers.
FIRST_FIGURE = {
    ("ellipse", "variants"): 1,
    ("eight", "variants"): 4,
    ("ellipse", "against"): 8,
    ("eight", "against"): 11,
}
GROUPS = {"variants": FOUR, "against": OLD}
UNTOLD: Content = {"optional_connections": []}
STALE = {"controller.stale": 1.0}
FOOTNOTE = {"controller.store_weight": 0.1}

Table = Mapping[str, Mapping[str, list[TrackingOutcome]]]


def needed(name: str) -> list[str]:
    """What is logged of a run with this controller."""
    more = LEARNING if "_cl_" in name else PHI if "_abs" in name else []
    return [*NEEDED, *more]


def variants(path: str, seconds: float | None) -> dict[str, dict[str, Content]]:
    """Condition -> controller -> scenario, for one path.

    Conditions are the observers ``mdf`` and ``kalman`` and ``true`` states; beside them samples of all
    forces (``ungated``), of which the controller knows only the ``request``, and the printed algorithms
    with ``stale`` stored errors, with and without the weight of footnote 1.
    """
    base = shipped(path)
    if seconds is not None:
        base = vary(base, stop=seconds, metrics={"from": 0.5 * seconds})
    found: dict[str, dict[str, Content]] = {}
    for name in CONTROLLERS:
        plain = vary(base, {"controller": f"{name}.fmu"}, log={"signals": needed(name)})
        for sense in SENSES:
            found.setdefault(sense, {})[name] = vary(plain, {"observer": f"observer_{sense}.fmu"})
        found.setdefault("true", {})[name] = true_states(plain)
        if name not in FOUR:
            continue
        ungated = vary(plain, parameters=UNGATED)
        request = {**ungated, **UNTOLD}
        stale = vary(request, parameters=STALE)
        of_each = {
            "ungated": ungated,
            "request": request,
            "stale": stale,
            "stale, 0.1": vary(stale, parameters=FOOTNOTE),
        }
        for what, content in of_each.items():
            found.setdefault(f"mdf, {what}", {})[name] = content
            found.setdefault(f"true, {what}", {})[name] = true_states(content)
    return found


def seeds_of(condition: str, seeds: Sequence[int]) -> Sequence[int]:
    """The seeds of a condition: one where nothing is random, few for an experiment on the cause."""
    if condition.startswith("true"):
        return seeds[:1]
    return seeds if condition in SENSES else seeds[:3]


def run(seeds: Sequence[int], seconds: float | None, jobs: int | None) -> Mapping[str, Table]:
    """Path -> condition -> controller -> outcomes by seed."""
    todo = {
        (path, condition, controller): content
        for path in PATHS
        for condition, contents in variants(path, seconds).items()
        for controller, content in contents.items()
    }
    some = {key: seeds_of(key[1], seeds) for key in todo}
    with progress(sum(map(len, some.values())), "chapter 5") as advance:
        outcomes = run_each(todo, some, outcome, processes=jobs, advance=advance)
    found: dict[str, dict[str, dict[str, list[TrackingOutcome]]]] = {}
    for (path, condition, controller), each in outcomes.items():
        found.setdefault(path, {}).setdefault(condition, {})[controller] = each
    return found


def tables(report: Report, path: str, by_condition: Table) -> None:
    """The numbers of one path."""
    report.heading(f"{path.capitalize()}")
    header = ["controller", "position [m]", "second half [m]", "heading [rad]", "error of ω̂ sway [N]"]
    header += ["error of ω̂ yaw [N m]", "IAEWWT", "σ_min", "rank met"]
    for condition, outcomes in by_condition.items():
        count = len(next(iter(outcomes.values())))
        kind = "one run without noise" if condition.startswith("true") else f"{count} seeds"
        starts = sorted({o.start for o in next(iter(outcomes.values())) if o.done})
        report.text(f"**{condition}**, {kind}; from {', '.join(f'{t:g}' for t in starts)} s on:")
        names = ("position", "second", "heading", "omega_Y", "omega_N", "iaewwt", "sigma", "rank")
        rows = []
        for controller, each in outcomes.items():
            broken = sum(not o.done for o in each)
            cells = [str(interval(columns(each, name))) for name in names]
            rows.append([controller + (f" ({broken} aborted)" if broken else ""), *cells])
        report.table(header, rows)


def differences(report: Report, by_path: Mapping[str, Table]) -> None:
    """Paired ratios of position errors against adaptive backstepping."""
    report.heading("Position error as a share of that of adaptive backstepping")
    report.text("Geometric mean over the seeds with its 95 % interval, same seeds on both sides.")
    others = [c for c in CONTROLLERS if c != "controller_abs"]
    rows = []
    for path, table in by_path.items():
        for sense in SENSES:
            base = columns(table[sense]["controller_abs"], "position")
            shares = [str(ratio(columns(table[sense][c], "position"), base)) for c in others]
            rows.append([f"{path}, {sense}", *shares])
    report.table(["run", *map(short, others)], rows)


def pictures(report: Report, seconds: float | None, jobs: int | None) -> None:
    """The five pictures of 5.1 for both groups of controllers on both paths, and Fig. 5.7.

    With noise and the thesis' observer, and as printed: no noise, stale errors with the weight 0.1.
    """
    logs = report.folder / "logs"
    if report.draws:
        contents = {}
        for path in PATHS:
            by = variants(path, seconds)
            for kind, runs in (("today", by["mdf"]), ("printed", {**by["true"], **by[PRINTED]})):
                for name, content in runs.items():
                    contents[f"{path}/{kind}/{name}"] = vary(content, log={"signals": "all"})
        run_all(contents, [0], done, logs, jobs)
    for kind in ("today", "printed"):
        for (path, group), number in FIRST_FIGURE.items():
            runs = {short(n): logs / path / kind / n / "0" for n in GROUPS[group]}
            folder = f"{path}_{group}_{kind}"
            report.draw(folder, runs)
            for file, figure in numbered(number).items():
                caption = f"{path}, {group}, {kind}: {file.replace('_', ' ')} (seed 0, {figure})"
                report.picture(f"{folder}/{file}.png", caption)
        caption = f"Smallest singular value, {kind} (seed 0, Fig. 5.7)"
        report.figure(f"singular_values_{kind}", partial(singular_values, logs, kind), caption)


def numbered(first: int) -> dict[str, str]:
    """The five pictures of 5.1 with the thesis' numbers of a scenario's figures."""
    numbers = (f"{first}a", f"{first}b", f"{first + 1}a", f"{first + 1}b", f"{first + 2}")
    names = ("trajectory", "errors", "metrics", "forces", "model_error")
    return {name: f"Fig. 5.{number}" for name, number in zip(names, numbers, strict=True)}


def done(run: FinishedRun) -> bool:
    """Whether a run went through."""
    return run.status == "done"


def singular_values(logs: Path, kind: str) -> Figure:
    """Smallest singular value of the store over time, the ellipse dash-dotted as in the thesis."""
    figure = Figure(figsize=(8.0, 4.0), layout="constrained")
    axes = figure.subplots()
    for path, style in zip(PATHS, ("-.", "-"), strict=True):
        for name, colour in zip(FOUR, ("blue", "green", "red", "magenta"), strict=True):
            log = cosim.read_log(logs / path / kind / name / "0")
            sigma = np.maximum(log["controller.sigma_min"], 1e-7)
            label = f"{short(name)}, {path}"
            axes.semilogy(log["time"], sigma, style, color=colour, linewidth=1.0, label=label)
    axes.set(xlabel="time [s]", ylabel="smallest singular value")
    axes.grid(alpha=0.3)
    figure.legend(loc="outside upper center", fontsize=7, ncols=4)
    return figure


def study(
    out: Path,
    seeds: Sequence[int],
    seconds: float | None,
    jobs: int | None,
    again: bool = False,
) -> Path:
    """Run everything, or take the outcomes of an earlier run, and write the report; returns its path."""
    earlier = stored(out) if again else None
    by_path = (
        run(seeds, seconds, jobs) if earlier is None else records(TrackingOutcome, earlier["outcomes"])
    )
    report = Report(out, "Chapter 5: which learning method tracks best?", seeds, earlier)
    report.text(
        "Plant: Table 2.1, corrected; controllers: gains of Table 5.1, without the damping by the "
        "yaw rate in their model. Noise 0.2 mm and 0.3 mrad, freezes of 0.1 to 1 s once in 20 s; "
        "`true` means the ship's own state. In the thesis stored errors become stale (Algorithms "
        "1 and 2 store ε itself) and their sum has the weight 0.1 (footnote 1 of 4.1.4); here "
        "they are computed anew and have weight 1. Samples of more than 2 N are left out by "
        "default. `ungated` stores them too, `request` does so without knowledge of the clipped "
        "force. `stale` is the printed form of that with weight 1, `stale, 0.1` with that of the "
        "footnote."
    )
    report.why(
        "the thesis' stored errors become stale and have the weight 0.1. Computed anew with weight 1, "
        "twenty stored samples dominate all four variants, so that ε, z2 and the store matter little."
    )
    report.text(
        "More weights: `python -m thesis.store_weight`. Pictures `printed`: true states, no noise, "
        "`stale, 0.1`; `today`: the shipped scenarios with the modified derivative filter. "
        "Columns: `today` judges the corrected algorithms with noise, `as printed` those of the thesis "
        "without (`true, stale, 0.1`)."
    )
    report.heading("Conclusions of the thesis, and results here")
    rows = [*claims(by_path), *statements(by_path), *store_claims(by_path), *goals(by_path)]
    report.verdicts("claims", rows, "numbers and reason")
    differences(report, by_path)
    for path, table in by_path.items():
        tables(report, path, table)
    report.heading("Pictures")
    pictures(report, seconds, jobs)
    report.result("outcomes", by_path)
    return report.write()


def main(arguments: Sequence[str] | None = None) -> None:
    """Command line."""
    parser = study_parser(
        "thesis.chapter5",
        "Compare backstepping, adaptive backstepping and concurrent learning as chapter 5 does.",
        "  python -m thesis.chapter5\n  python -m thesis.chapter5 --seeds 3 --out results/first_look",
        again=True,
    )
    options = parser.parse_args(arguments)
    seeds = range(2 if options.quick else options.seeds)
    seconds = 60.0 if options.quick else None
    run_study(partial(study, options.out, seeds, seconds, options.jobs, options.again))


if __name__ == "__main__":
    main()
