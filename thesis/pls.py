"""Partial least squares of the model error (3.1.3, 7.3).

``python -m thesis.pls RUN...``.
"""

if __name__ == "__main__":
    from cosim.supervision import supervised

    supervised()  # before all other imports, which take a while

import argparse
from collections.abc import Sequence

from cosim.command import run_command
from diagnosis.commands import Done, run, ship_option
from diagnosis.execution import Advance, together

from .command_options import analysis_parser, ssv_option

RESULT, MODEL, REPORT = FILES = ("pls.json", "model.ssv", "report.html")


def main(arguments: Sequence[str] | None = None) -> int:
    """Command line; returns the exit code."""
    return run(pls, _parser().parse_args(arguments))


def pls(options: argparse.Namespace, advance: Advance) -> Done:
    """Run the command with parsed options."""
    from .analysis import gather_samples, recipes  # only now: it takes a second to import

    recipe = recipes.recipe(options.recipe)
    recipe.transformer()  # before any work: a library may be missing
    from diagnosis.predictors import ship_with, write_model
    from diagnosis.report import write_document, write_json

    from .analysis.constrained_fit import nearest_stable
    from .analysis.into_the_plant import as_model, goes_into_the_plant, thrust_of
    from .analysis.partial_least_squares import regressed
    from .analysis.pls_report import content, document, sentences
    from .analysis.samples import joined, without_outliers

    of = ship_with((), options.ship)
    with together(options.out, FILES) as new:
        runs = gather_samples(options.runs, options.estimates, advance, of, options.anyway)
        samples = joined(runs)
        if not options.keep_outliers:
            advance("outliers")
            samples = without_outliers(samples)
        advance(f"regression {recipe.name}")
        found = regressed(samples, recipe)
        possible = goes_into_the_plant(found.columns)
        stable = None
        if options.stable:
            advance("nearest stable model")
            stable = nearest_stable(found.X, samples.omega, found.columns, found.B)
        written = possible and (options.ssv or stable is not None or thrust_of(found).holds)
        if written:
            c, B = (found.c, found.B) if stable is None else (stable.c, stable.B)
            write_model(new / MODEL, as_model(c, B, found.columns, of))
        write_json(new / RESULT, content(found, options.estimates, stable))
        advance("report")
        write_document(new / REPORT, document(found, options.estimates, stable))
    shown = [*sentences(found, stable)]
    if not possible:
        shown.append(f"{MODEL} is not written: the plant has no such columns.")
    elif not written:
        shown.append(f"{MODEL} is not written; --ssv writes it anyway.")
    files = [name for name in FILES if written or name != MODEL]
    return Done(0, [*shown, f"in {options.out}: {', '.join(files)}"])


def _parser() -> argparse.ArgumentParser:
    made = analysis_parser(
        "pls",
        "Regress the model error on velocity and force by partial least squares, with cross-validation.",
        "examples:  %(prog)s results/ellipse\n"
        "           %(prog)s run1.csv run2.csv --recipe PLS2 --stable --out results/2\n"
        "           python -m cosim.run scenarios/ellipse.json --parameters results/pls/model.ssv\n"
        "recipes:   PLS1 to PLS4 of Table 7.2; nominal, continuous: 3.2.2, 3.2.3\n"
        "exit codes: 0 done, 2 bad input, 130 interrupted (nothing is written)",
        "smoothed",
    )
    ship_option(made)
    made.add_argument("--recipe", default="PLS3", metavar="NAME", help="recipe of X (default: PLS3)")
    made.add_argument(
        "--keep-outliers", action="store_true", help="do not remove outliers by PCA beforehand (7.3)"
    )
    made.add_argument(
        "--stable",
        action="store_true",
        help=f"write the nearest model that is stable by construction to {MODEL}",
    )
    ssv_option(made)
    return made


if __name__ == "__main__":
    run_command(main)
