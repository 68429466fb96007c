"""The weight of the stored sums, footnote 1 of 4.1.4: ``python -m thesis.store_weight``.

The four variants of concurrent learning on both paths with the ship's true state and no noise: stored
errors formed anew or as printed (stale), samples of large forces left out or not, four weights; and once
more as printed, where learning takes the force that is asked for to be the one that acts.
"""

from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path

from studies.study_command import progress, run_study, study_parser
from studies.study_report import Report, Verdict, records, stored

from .chapter5 import PATHS, UNGATED, needed
from .monte_carlo import Content, run_all, shipped, vary
from .tracking.outcome import TrackingOutcome, outcome, true_states
from .tracking.store_verdicts import FULL
from .tracking.verdict import CONTROLLERS, FOUR, ORDERS, in_order, short

WEIGHTS = (1.0, 0.1, 0.05, 0.01)
# Of the table: fresh or stale, and whether samples of forces above 2 N are kept out.
FORMS = {
    "fresh, gated": {},
    "fresh, ungated": UNGATED,
    "stale, gated": {"controller.stale": 1.0},
    "stale, ungated": {"controller.stale": 1.0, **UNGATED},
}
# Forms of which the controller does not get the clipped force, as printed.
UNTOLD = {f"{form}, request": changes for form, changes in FORMS.items() if "ungated" in form}
PLAIN = "as it is"

Found = Mapping[str, Mapping[str, Sequence[TrackingOutcome]]]


def variants(path: str, seconds: float | None) -> dict[str, Content]:
    """``controller|form|weight`` -> scenario, for one path."""
    base = shipped(path)
    if seconds is not None:
        base = vary(base, stop=seconds, metrics={"from": 0.5 * seconds})
    found: dict[str, Content] = {}
    for name in CONTROLLERS:
        own = true_states(vary(base, {"controller": f"{name}.fmu"}, log={"signals": needed(name)}))
        if name not in FOUR:
            found[f"{name}|{PLAIN}|1"] = own
            continue
        for form, changes in (FORMS | UNTOLD).items():
            stated: Content = {} if form in FORMS else {"optional_connections": []}
            for weight in WEIGHTS:
                values = {**changes, "controller.store_weight": weight}
                found[f"{name}|{form}|{weight:g}"] = vary(own, parameters=values, **stated)
    return found


def tables(report: Report, path: str, found: Mapping[str, Sequence[TrackingOutcome]]) -> None:
    """The position errors of one path, and whether they are in the thesis' order for it."""
    plain = {short(k.split("|")[0]): o[0].position for k, o in found.items() if PLAIN in k}
    report.heading(path.capitalize())
    report.text(
        f"Position error, RMS [m]. {', '.join(f'{n}: {x:.4f}' for n, x in plain.items())}. The thesis' "
        f"order on this path, best first: {', '.join(ORDERS[path])}."
    )
    names = [short(n) for n in FOUR]
    rows, sigmas = [], []
    for form in FORMS | UNTOLD:
        for weight in WEIGHTS:
            runs = {short(n): found[f"{n}|{form}|{weight:g}"][0] for n in FOUR}
            errors = {name: o.position for name, o in runs.items()}
            same = "yes" if in_order(errors | plain, path) else "no"
            rows.append([f"{form}, {weight:g}", *(f"{x:.4f}" for x in errors.values()), same])
            shown = [f"{o.sigma:.2g} ({100.0 * o.rank:.0f} %)" for o in runs.values()]
            sigmas.append([f"{form}, {weight:g}", *shown])
    report.table(["stored errors, samples, weight", *names, "thesis' order"], rows)
    report.text(
        f"{sum(row[-1] == 'yes' for row in rows)} of {len(rows)} settings have the thesis' order."
    )
    report.text(
        "σ_min of the store at the end, and the share of the time in which Condition 1 is met "
        f"(σ_min above {FULL:g}):"
    )
    report.table(["stored errors, samples, weight", *names], sigmas)


def stable(path: str, found: Mapping[str, Sequence[TrackingOutcome]]) -> Verdict:
    """Whether the printed algorithms with the weight 0.1 are no worse than without adaptation."""
    form = "stale, ungated, request"
    errors = {short(n): found[f"{n}|{form}|0.1"][0].position for n in FOUR}
    plain = found[f"controller_bs|{PLAIN}|1"][0].position
    return Verdict(
        f"ρ = 0.1 makes the adaptation stable (footnote 1 of 4.1.4): {path}",
        {n: x < plain for n, x in errors.items()},
        f"position error below that of backstepping, {plain:.4f} m: "
        + ", ".join(f"{n} {x:.4f} m" for n, x in errors.items()),
    )


def run(paths: Sequence[str], seconds: float | None, jobs: int | None) -> Found:
    """Path -> ``controller|form|weight`` -> its one outcome."""
    todo = {path: variants(path, seconds) for path in paths}
    with progress(sum(map(len, todo.values())), "store weight") as advance:
        return {p: run_all(c, [0], outcome, None, jobs, advance) for p, c in todo.items()}


def study(
    out: Path, paths: Sequence[str], seconds: float | None, jobs: int | None, again: bool = False
) -> Path:
    """Run, or take the outcomes of an earlier run, and write the report; returns its path."""
    earlier = stored(out) if again else None
    by_path = (
        run(paths, seconds, jobs)
        if earlier is None
        else {p: records(TrackingOutcome, earlier[p]) for p in PATHS if p in earlier}
    )
    report = Report(out, "The weight of the stored sums", (), earlier)
    report.text(
        "Footnote 1 of 4.1.4 reduces the stored part of the adaptation by ρ = 0.1: a weight of "
        "every stored sum. True states, no noise, one run each. `stale`: stored errors as "
        "Algorithms 1 and 2 print them. `ungated`: samples of forces above 2 N are stored too. "
        "`request`: the controller does not get the clipped force and learns from its requested "
        "force, as printed."
    )
    report.why(
        "on the eight the thrusters saturate, and samples with a requested force that did not act are "
        "stored."
    )
    for path, found in by_path.items():
        tables(report, path, found)
        report.verdicts(f"claims_{path}", [stable(path, found)])
        report.result(path, found)
    return report.write()


def main(arguments: Sequence[str] | None = None) -> None:
    """Command line."""
    parser = study_parser(
        "thesis.store_weight",
        "Compare weights of the stored sums (footnote 1 of 4.1.4).",
        "  python -m thesis.store_weight\n  python -m thesis.store_weight --quick",
        seeds=None,
        again=True,
    )
    parser.add_argument("--path", choices=PATHS, help="only this path (default: both)")
    options = parser.parse_args(arguments)
    paths = (options.path,) if options.path else PATHS
    seconds = 60.0 if options.quick else None
    run_study(partial(study, options.out, paths, seconds, options.jobs, options.again))


if __name__ == "__main__":
    main()
