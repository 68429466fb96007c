"""What the diagnosis makes of a problem, in the keys of ``diagnosis.json``; scored elsewhere."""

import json
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from cosim import InputError, atomic_write
from diagnosis import (
    Comparison,
    Model,
    WeakWindows,
    clean,
    diagnose,
    diagnosis_content,
    evaluate_run,
    method,
    smooth,
    weak_windows,
)
from diagnosis.execution.progress import silent
from diagnosis.predictors import LEVELS, Bands

from .cells import Key
from .problems import Problem, kept, slug

PEERS = ("sindy", "pls")
NOTHING_FOUND, FAILED = "nothing", "failed"  # in place of a peer's first effect
# Parts of diagnosis.json that no score needs, and that are long.
LEFT_OUT = ("where", "where_after", "data", "versions", "runs", "files")
Answer = dict[str, Any]


def answer(problem: Problem, peers: bool) -> Answer:
    """What the diagnosis says of the measured runs of a problem; it gets nothing else.

    Returns:
        ``diagnosis.json`` without what no score needs; besides ``evidence``, what the confidence of each
        finding is made of (None where the method has none), ``posterior``, names, mean and covariance of
        what was fitted, ``bands``, see :func:`window_shares`, ``seconds`` of processor time from
        measured runs to the answer, ``worse``, which predictions of the run held out became worse,
        ``truth_mm``, the window position error of the true model on that run (None where the diagnosis
        has none of its form), and ``peers``, what others find first.
    """
    if problem.note:
        return {"note": problem.note}
    begun = time.process_time()
    *train, last = (weak_windows(smooth(clean(run))) for run in problem.runs)
    try:
        diagnosis = diagnose(train, [last], problem.prior)
        content = diagnosis_content(diagnosis, None, [])
    except InputError as error:
        return {"note": str(error)}
    seconds = time.process_time() - begun
    found = {name: value for name, value in content.items() if name not in LEFT_OUT}
    pairs = zip(diagnosis.learned.effects, diagnosis.believed, strict=True)
    stated = [f.evidence for f, is_finding in pairs if is_finding]
    posterior = diagnosis.posterior
    names = [name.partition(".")[2] for name in posterior.names]
    found["posterior"] = [names, posterior.mean.tolist(), posterior.covariance.tolist()]
    found["bands"] = within_bands(diagnosis.comparison)
    found["evidence"] = [None if e is None else list(map(float, e)) for e in stated]
    found |= {"seconds": seconds, "truth_mm": truth(problem, last)}
    found["worse"] = [name for name, is_worse in predictions(diagnosis.comparison).items() if is_worse]
    if peers and problem.hidden:
        found["peers"] = {peer: first_effect(peer, train) for peer in PEERS}
    return found


def within_bands(comparison: Comparison) -> list[list[float]]:
    """The same as :func:`window_shares`, of the last run; nothing where it has no window."""
    e = comparison.evaluations[-1]
    return [] if e.bands is None else window_shares(e.bands, e.after.residuals)


def window_shares(bands: Bands, residuals: np.ndarray) -> list[list[float]]:
    """For the bands of 50 and 90 % the share of each window's samples that lie within them.

    Args:
        bands: of a run.
        residuals: (samples, 3), measured minus predicted pose; positions and headings count alike.
    """
    window = bands.windows.sample_window
    inside = [bands.inside(residuals, level).mean(axis=1) for level in LEVELS]
    return [(np.bincount(window, x) / np.bincount(window)).tolist() for x in inside]


def predictions(comparison: Comparison) -> dict[str, bool]:
    """Whether positions and headings of the last run are predicted worse than before."""
    before, after = comparison.evaluations[-1].before.errors, comparison.evaluations[-1].after.errors
    if before is None or after is None:
        return {}
    changes = {n: getattr(after, n) ** 2 - getattr(before, n) ** 2 for n in ("position", "heading")}
    return {n: bool(d.sum() > 2.0 * np.sqrt(d.size) * d.std()) for n, d in changes.items()}


def truth(problem: Problem, held_out: WeakWindows) -> float | None:
    """Window position error [mm] of the true model; None where the diagnosis has none of its form."""
    if problem.vessel is None or problem.thrusters is None:
        return None
    model = Model(problem.vessel, problem.thrusters, {"clock_offset": problem.clock})
    return 1e3 * evaluate_run(held_out, model).before.position


def first_effect(peer: str, data: Sequence[WeakWindows]) -> str:
    """Id of the first effect that another method finds."""
    chosen = method(peer)
    try:
        found = chosen.fit(data, Model(), 0.0, silent, 0).effects
    except InputError:
        return FAILED
    return found[0].id if found else NOTHING_FOUND


def judge(key: Key, problems: Path, answers: Path, peers: bool) -> Key:
    """Let the diagnosis answer a problem, and keep the answer."""
    found = answer(kept(key, problems), peers)
    with atomic_write(path_of(key, answers)) as part:
        part.write_text(json.dumps(found, indent=1), encoding="utf-8")
    return key


def path_of(key: Key, answers: Path) -> Path:
    """The file of an answer."""
    return answers / f"{slug(key)}.json"


def kept_answer(key: Key, answers: Path) -> Answer:
    """An answer that was given before."""
    return json.loads(path_of(key, answers).read_text(encoding="utf-8"))
