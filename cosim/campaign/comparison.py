"""Paired differences between the values of an axis, and when they are known well enough."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Iterable, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ..dispatch.job import RunRow
from ..errors import InputError, nearest
from ..trials.measures import EVERY
from .design import Case

if TYPE_CHECKING:
    import pandas

LEVEL = 0.95  # of all intervals; the custom of the field
# Pairs before a sequential rule may stop; with 10 the coverage is within 2 % of LEVEL for normal
# differences (tests/test_campaign_statistics.py simulates it), with 2 it is not.
FEWEST_PAIRS = 10
UNPAIRED = "no two runs differ in '{}' only, so a comparison is not possible"


class MeanInterval(NamedTuple):
    """A mean and the half width of the interval that holds the true one with probability LEVEL."""

    mean: float
    half: float


def interval(values: Sequence[float]) -> MeanInterval:
    """Student's t interval of the mean of independent values."""
    x = np.asarray(values, float)
    if x.size < 2:
        return MeanInterval(float(x.mean()) if x.size else math.nan, math.inf)
    from scipy.special import stdtrit  # takes less time to import than scipy.stats

    half = float(stdtrit(x.size - 1, 0.5 + 0.5 * LEVEL) * x.std(ddof=1) / math.sqrt(x.size))
    return MeanInterval(float(x.mean()), half)


def _demand_axis(axis: str, axes: Sequence[str], where: str = "") -> None:
    if axis not in axes:
        raise InputError(f"{where}no axis '{axis}'{nearest(axis, axes)}")


def _demand_metrics(metrics: Iterable[str], where: str = "") -> None:
    names = [metric.name for metric in EVERY]
    for metric in metrics:
        if metric not in names:
            raise InputError(f"{where}no metric '{metric}'{nearest(metric, names)}")


def _blocks(every: Sequence[Case], axis: str) -> list[dict[str, Case]]:
    """The runs that differ in the axis alone, by what the table shows of it."""
    blocks: dict[str, dict[str, Case]] = {}
    for case in every:
        others = {name: value for name, value in case.values.items() if name != axis}
        block = blocks.setdefault(json.dumps(others, sort_keys=True), {})
        block[_shown(case.shown[axis])] = case
    return [*blocks.values()]


def check_request(every: Sequence[Case], axis: str | None, metrics: Iterable[str]) -> None:
    """Refuse before anything runs what the table could not answer.

    Args:
        every: all runs.
        axis: whose values are to be compared; None compares none.
        metrics: of comparisons, pictures and the Pareto set.

    Raises:
        InputError: no such axis or metric, or no two runs that differ in the axis alone.
    """
    _demand_metrics(metrics)
    if axis is None:
        return
    _demand_axis(axis, list(every[0].shown))
    if all(len(block) < 2 for block in _blocks(every, axis)):
        raise InputError(UNPAIRED.format(axis))


class StopRule:
    """Stops as soon as the interval of a paired difference is narrow enough.

    The rule of Chow and Robbins (On the asymptotic theory of fixed-width sequential confidence intervals
    for the mean, Ann. Math. Statist. 36, 1965): after each pair, in a fixed order, stop when the half
    width of the interval so far is at most the one wanted; the interval then has its level
    asymptotically. Here with Student's t in place of the normal quantile, and not before
    ``FEWEST_PAIRS``. A pair is two runs that differ in nothing but the axis; the first value of the axis
    is compared with each other one, and the rule waits for all. Pairs are taken in an order shuffled by
    the campaign's seed, so that whenever it stops it has seen a fair sample of all.

    Args:
        text: ``"axis metric width"``: width is that of the difference in the metric's unit, or, as
            ``2%``, that of the ratio (of its logarithm, as the metric is positive).
        cases: all runs.
        seed: of the order.

    Attributes:
        ordered: all runs in the order in which they are to be made.

    Raises:
        InputError: not of that form, no such axis or metric, or a value of the axis that has no partner.
    """

    def __init__(self, text: str, cases: Sequence[Case], seed: int) -> None:
        words = text.split()
        if len(words) != 3:
            raise InputError(
                f"'{text}' is not a rule: it takes the form 'axis metric width', as in 'K e_pos_rms 2%'"
            )
        self.axis, self.metric, width = words
        _demand_axis(self.axis, list(cases[0].shown), f"'{text}': ")
        _demand_metrics([self.metric], f"'{text}': ")
        self.relative = width.endswith("%")
        try:
            self.width = float(width.removesuffix("%")) / (100.0 if self.relative else 1.0)
        except ValueError:
            self.width = math.nan
        if not 0.0 < self.width < math.inf:
            raise InputError(
                f"'{text}': '{width}' is not a width: a positive number, or a share as in 2%"
            )
        self._blocks = self._order(text, cases, seed)
        self.ordered = [case for block in self._blocks for case in block.values()]
        self._differences: dict[str, list[float]] = {name: [] for name in list(self._blocks[0])[1:]}
        self._seen = self._failed = 0
        self._satisfied = False

    def _order(self, text: str, cases: Sequence[Case], seed: int) -> list[dict[str, Case]]:
        """The runs that differ in the axis alone, shuffled."""
        blocks = _blocks(cases, self.axis)
        values = dict.fromkeys(_shown(case.shown[self.axis]) for case in cases)
        if len(values) < 2 or any(len(block) < len(values) for block in blocks):
            raise InputError(
                f"'{text}': no pairs to compare: each value of '{self.axis}' needs the same values "
                'of the other axes, in a grid, or with "cross": true in a sample'
            )
        order = np.random.default_rng(seed).permutation(len(blocks))
        return [{name: blocks[k][name] for name in values} for k in order]

    def satisfied(self, row: Callable[[int], RunRow | None]) -> bool:
        """Whether the difference is known.

        Args:
            row: gives what is kept of a run by its number, if it has ended.
        """
        while not self._satisfied and self._seen < len(self._blocks):
            block = [row(case.number) for case in self._blocks[self._seen].values()]
            if any(r is None for r in block):
                return False
            self._seen += 1
            found = [r.metrics.get(self.metric, math.nan) for r in block if r is not None]
            if not np.isfinite(found).all():
                self._failed += 1
                continue
            for other, value in zip(self._differences, found[1:], strict=True):
                self._differences[other].append(self._difference(found[0], value))
            pairs = self._seen - self._failed
            halves = [interval(d).half for d in self._differences.values()]
            wanted = math.log1p(self.width) if self.relative else self.width
            self._satisfied = pairs >= FEWEST_PAIRS and max(halves) <= wanted
        return self._satisfied

    def _difference(self, first: float, other: float) -> float:
        if not self.relative:
            return other - first
        if min(first, other) <= 0.0:
            raise InputError(
                f"{self.metric} is not positive, so a relative width is undefined; give a width in "
                "its unit"
            )
        return math.log(other / first)

    def counted(self, row: Callable[[int], RunRow | None]) -> set[int] | None:
        """Numbers of the runs from which the difference is known; None if it is not: then all count."""
        if not self.satisfied(row):
            return None
        return {case.number for block in self._blocks[: self._seen] for case in block.values()}

    def verdict(self, row: Callable[[int], RunRow | None]) -> dict[str, Any]:
        """What is known, for campaign.json: differences from the first value, or ratios less one."""
        stated: dict[str, Any] = {"known": self.satisfied(row), "pairs": self._seen - self._failed}
        stated |= {"axis": self.axis, "metric": self.metric, "against": next(iter(self._blocks[0]))}
        for name, differences in self._differences.items():
            mean, half = interval(differences)
            ends = [mean, mean - half, mean + half]
            ends = [math.expm1(x) if self.relative else x for x in ends]
            kind = "ratio_less_one" if self.relative else "difference"
            stated.setdefault(kind, {})[name] = ends if np.isfinite(ends).all() else None
        return stated


def _shown(value: Any) -> str:
    return value if isinstance(value, str) else json.dumps(value)


def differences(
    made: pandas.DataFrame, axes: Sequence[str], axis: str, metrics: Sequence[str]
) -> pandas.DataFrame:
    """Each value of an axis against its first one, over runs that agree in all other axes.

    Args:
        made: the table of the campaign.
        axes: all axes.
        axis: the one to compare.
        metrics: columns.

    Returns:
        One row for each value and metric: ``value``, ``against``, ``metric``, ``pairs``, the mean
        ``difference`` with the ``half`` width of its interval, and for positive metrics ``percent``,
        the geometric mean of the ratio less one, with its interval ``percent_low``, ``percent_high``.

    Raises:
        InputError: no such axis or metric, or nothing to pair.
    """
    import pandas

    _demand_axis(axis, axes)
    _demand_metrics(metrics)
    others = [name for name in axes if name != axis]
    done = made.query("status == 'done'")
    parts = {value: done.loc[done[axis] == value] for value in dict.fromkeys(made[axis])}
    against, first_part = next(iter(parts.items()))
    rows: list[dict[str, Any]] = []
    for value, part in list(parts.items())[1:]:
        how: dict[str, Any] = {"on": others} if others else {"how": "cross"}
        both = first_part.merge(part, suffixes=("_a", "_b"), **how)
        for metric in metrics:
            pair = both.loc[:, [f"{metric}_a", f"{metric}_b"]].to_numpy(float)
            first, second = pair[np.isfinite(pair).all(axis=1)].T
            mean, half = interval((second - first).tolist())
            row = {"value": _shown(value), "against": _shown(against), "metric": metric}
            row |= {"pairs": len(first), "difference": mean, "half": half}
            if len(first) and min(first.min(), second.min()) > 0.0:
                log = interval(np.log(second / first).tolist())
                ends = (log.mean, log.mean - log.half, log.mean + log.half)
                names = ("percent", "percent_low", "percent_high")
                row |= {n: 100.0 * float(np.expm1(x)) for n, x in zip(names, ends, strict=True)}
            rows.append(row)
    if not any(row["pairs"] for row in rows):
        failed = int((made["status"] != "done").sum())
        why = f"{failed} of {len(made)} runs failed, and no pair is complete"
        raise InputError(f"--compare {axis}: {why}" if failed else UNPAIRED.format(axis))
    return pandas.DataFrame(rows)


def pareto(
    made: pandas.DataFrame, axes: Sequence[str], metrics: Sequence[str], over: Sequence[str]
) -> pandas.DataFrame:
    """The choices that no other one beats in all metrics; smaller is better.

    Args:
        made: the table of the campaign.
        axes: all axes.
        metrics: columns.
        over: axes over which metrics are averaged first, as over seeds; a choice of which a run failed
            is left out.

    Returns:
        One row for each such choice: its axes, the means of the metrics, ``runs``.

    Raises:
        InputError: no such metric, or no choice is left.
    """
    _demand_metrics(metrics)
    by = [name for name in axes if name not in over]
    if not by:
        raise InputError("there is only one choice, because all axes are averaged")
    groups = made.assign(done=made["status"] == "done").groupby(by, sort=False)
    means = groups.agg(dict.fromkeys(metrics, "mean") | {"done": "all", "hash": "size"})
    means = means.rename(columns={"hash": "runs"}).reset_index().query("done").dropna()
    points = means.loc[:, list(metrics)].to_numpy(float)
    kept = [not ((points <= p).all(axis=1) & (points < p).any(axis=1)).any() for p in points]
    if not any(kept):
        raise InputError("no choice is left: each has a failed run")
    best = means.iloc[np.flatnonzero(kept)].drop(columns="done")
    return best.sort_values(by=metrics[0]).reset_index(drop=True)
