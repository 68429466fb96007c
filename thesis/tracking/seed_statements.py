"""What 5.3.1, 5.3.2, 5.4.1 and 5.4.2 say of single runs, judged seed by seed."""

from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple

from scipy import stats

from studies.study_report import Verdict

from ..monte_carlo import interval
from .outcome import TrackingOutcome, columns
from .verdict import PRINTED, RELATED, Paths, Table, short

Run = Mapping[str, TrackingOutcome]  # controllers of one seed
SUBSTANTIALLY = 1.25  # times an error that is "substantially" larger; chosen
LEAVES = 0.2  # m, position error over the last tenth of a run that left its path; chosen
EPS, Z2 = ("svd_eps", "win_eps"), ("svd_z2", "win_z2")
VARIANTS = (*EPS, *Z2)
EVERY = ("bs", "abs", *VARIANTS)


class Statement(NamedTuple):
    """A statement on the runs of one path.

    Attributes:
        text: of the thesis.
        path: of the runs.
        numbers: fields of the outcomes on which it rests.
        names: controllers whose numbers are shown.
        holds: whether one seed's runs satisfy it.
    """

    text: str
    path: str
    numbers: Sequence[str]
    names: Sequence[str]
    holds: Callable[[Run], bool]


def centred(run: Run) -> bool:
    return abs(run["win_eps"].bias) > abs(run["svd_eps"].bias)


def weaker(run: Run) -> bool:
    pairs = (("svd_eps", "svd_z2"), ("win_eps", "win_z2"))
    return all(run[b].position > SUBSTANTIALLY * run[a].position for a, b in pairs) and worst_of(
        run, "svd_z2", "position"
    )


def worst_of(run: Run, name: str, number: str) -> bool:
    """Whether a variant of concurrent learning has the largest number of the four."""
    return all(getattr(run[name], number) >= getattr(run[n], number) for n in VARIANTS)


def relieves_feedback(run: Run) -> bool:
    """Whether controllers with a better estimate of ω use less feedback and more feed-forward."""
    wrong = [run[n].omega_Y for n in EVERY]
    rank = [
        float(stats.spearmanr(wrong, [getattr(run[n], key) for n in EVERY])[0])  # pyright: ignore[reportArgumentType]
        for key in ("linear", "nonlinear")
    ]
    return rank[0] > RELATED and rank[1] < -RELATED


def alone_leaves(run: Run) -> bool:
    return [n for n in VARIANTS if not run[n].end < LEAVES] == ["svd_z2"]


def best_by_metrics(run: Run) -> bool:
    return all(
        max(getattr(run[n], key) for n in EPS) < min(getattr(run[n], key) for n in Z2)
        for key in ("iaew", "iaewwt")
    )


def highest_feed_forward(run: Run) -> bool:
    others = ("abs", "bs", "win_z2")
    return all(
        run["svd_eps"].nonlinear > run[n].nonlinear and run["svd_eps"].linear < run[n].linear
        for n in others
    )


def knows_sway(run: Run) -> bool:
    return max(run["svd_eps"].omega_Y, run["win_z2"].omega_Y) < run["abs"].omega_Y


def wrong_in_yaw(run: Run) -> bool:
    return all(run[n].agree_N < 0.0 for n in Z2) and run["abs"].agree_N > 0.0


def outward(run: Run) -> bool:
    return all(run[n].inside < 0.0 for n in ("bs", "abs"))


STATEMENTS = (
    Statement(
        "CL-WIN-ε has a bias across the path, CL-SVD-ε has none (5.3.1, Fig. 5.1b)",
        "ellipse",
        ("bias",),
        EPS,
        centred,
    ),
    Statement(
        "With z2 tracking is substantially weaker, above all that of CL-SVD-z2 (5.3.1)",
        "ellipse",
        ("position",),
        VARIANTS,
        weaker,
    ),
    Statement(
        "A better estimate of ω means less feedback and more feed-forward (5.3.1, Fig. 5.2b)",
        "ellipse",
        ("omega_Y", "linear", "nonlinear"),
        EVERY,
        relieves_feedback,
    ),
    Statement(
        "CL-SVD-z2 alone leaves the path at the end (5.3.2)",
        "eight",
        ("end",),
        VARIANTS,
        alone_leaves,
    ),
    Statement(
        "The estimate of CL-SVD-z2 in sway is the worst of the four (5.3.2, Fig. 5.6)",
        "eight",
        ("omega_Y",),
        VARIANTS,
        lambda run: worst_of(run, "svd_z2", "omega_Y"),
    ),
    Statement(
        "Both variants with ε are best by IAEW and IAEWWT (5.3.2, Fig. 5.5a)",
        "eight",
        ("iaew", "iaewwt"),
        VARIANTS,
        best_by_metrics,
    ),
    Statement(
        "CL-WIN-z2 estimates the opposite in yaw (5.3.2)",
        "eight",
        ("agree_N",),
        VARIANTS,
        lambda run: run["win_z2"].agree_N < 0.0,
    ),
    Statement(
        "CL-SVD-ε has the largest feed-forward and the least feedback (5.4.1, Fig. 5.9b)",
        "ellipse",
        ("nonlinear", "linear"),
        ("abs", "bs", "svd_eps", "win_z2"),
        highest_feed_forward,
    ),
    Statement(
        "CL estimates ω in sway better than ABS (5.4.2, Fig. 5.13)",
        "eight",
        ("omega_Y",),
        ("abs", "svd_eps", "win_z2"),
        knows_sway,
    ),
    Statement(
        "Both variants with z2 adapt the wrong way in yaw, ABS does not (5.4.2)",
        "eight",
        ("agree_N",),
        ("abs", *Z2),
        wrong_in_yaw,
    ),
    Statement(
        "The hydrodynamic forces push the ship outward on the eight (5.4.2)",
        "eight",
        ("inside",),
        ("bs", "abs"),
        outward,
    ),
    Statement(
        "They do so on the ellipse (5.4.2)",
        "ellipse",
        ("inside",),
        ("bs", "abs"),
        outward,
    ),
)


def runs_of(table: Table, condition: str) -> Mapping[str, Sequence[TrackingOutcome]]:
    """Runs of all controllers; those as printed have backstepping and ABS of the true states."""
    runs = table[condition] if condition != PRINTED else {**table["true"], **table[PRINTED]}
    return {short(c): each for c, each in runs.items()}


def in_seeds(
    runs: Mapping[str, Sequence[TrackingOutcome]], holds: Callable[[Run], bool]
) -> tuple[bool | None, str]:
    """Whether every seed's runs satisfy a statement, or none does; None: some do. And their count."""
    seeds = [dict(zip(runs, each, strict=True)) for each in zip(*runs.values(), strict=True)]
    good = sum(holds(run) for run in seeds)
    return {0: False, len(seeds): True}.get(good), f"{good} of {len(seeds)}"


def judged_statement(statement: Statement, by_path: Paths) -> Verdict:
    """The verdict on a statement, of today's controllers with noise and of those as printed."""
    answers, counts, numbers = {}, [], []
    for condition in ("mdf", PRINTED):
        runs = runs_of(by_path[statement.path], condition)
        answers[condition], count = in_seeds(runs, statement.holds)
        counts.append(f"{condition} {count}")
        for key in statement.numbers:
            values = [f"{n} {interval(columns(runs[n], key)).mean:.3g}" for n in statement.names]
            numbers.append(f"{key}, {condition}: {', '.join(values)}")
    said = f"seeds in which it holds: {', '.join(counts)}. {'; '.join(numbers)}"
    return Verdict(statement.text, answers["mdf"], said, answers[PRINTED])


def statements(by_path: Paths) -> list[Verdict]:
    """Every statement with its verdict."""
    return [judged_statement(each, by_path) for each in STATEMENTS]
