"""The values of every axis in every run: grids, lists, Latin hypercubes and Sobol sequences."""

from collections.abc import Iterator
from itertools import product
from math import prod
from statistics import NormalDist
from typing import Any, NamedTuple

import numpy as np

from ..errors import InputError
from .campaign_file import MOST_RUNS, Campaign, CampaignAxis, Latin

# Drawn shares stay this far from 0 and 1, where a normal distribution has no finite value; the spacing
# of doubles below 1.
EDGE = 2.0**-53


class Case(NamedTuple):
    """One run of a campaign.

    Attributes:
        number: its place in the design, from 0 on.
        values: what each axis sets.
        shown: what the table shows of each axis.
    """

    number: int
    values: dict[str, Any]
    shown: dict[str, Any]


def cases(campaign: Campaign) -> list[Case]:
    """All runs, in the order of the design: the last axis changes fastest.

    Raises:
        InputError: too many.
    """
    axes = campaign.axes
    if campaign.design == "list":
        count = len(next(iter(axes.values())).values or ())
        rows = zip(*map(_choices, axes.values()), strict=True)
        chosen = (dict(zip(axes, row, strict=True)) for row in rows)
    else:  # a grid is crossed as a whole, a sample is drawn
        design = campaign.design
        crossed = {name: axis for name, axis in axes.items() if axis.cross or design == "grid"}
        size = 1 if design == "grid" else design.latin if isinstance(design, Latin) else design.sobol
        count = size * prod(len(axis.values or ()) for axis in crossed.values())
        chosen = (
            sample | dict(zip(crossed, row, strict=True))
            for sample in ([{}] if design == "grid" else _samples(campaign, size))
            for row in product(*map(_choices, crossed.values()))
        )
    if count > MOST_RUNS:
        raise InputError(f"{count} runs are more than {MOST_RUNS}")
    return [
        Case(k, {n: row[n][0] for n in axes}, {n: row[n][1] for n in axes})
        for k, row in enumerate(chosen)
    ]


def _choices(axis: CampaignAxis) -> list[tuple[Any, Any]]:
    """The values of an axis, each with what the table shows of it."""
    values = axis.values or []
    return list(zip(values, axis.labels or values, strict=True))


def _samples(campaign: Campaign, size: int) -> Iterator[dict[str, tuple[Any, Any]]]:
    """The drawn values of each sample."""
    from scipy.stats import qmc  # takes a while to import

    drawn = {name: axis for name, axis in campaign.axes.items() if not axis.cross}
    rng = np.random.default_rng(campaign.seed)
    if isinstance(campaign.design, Latin):
        shares = qmc.LatinHypercube(len(drawn), rng=rng).random(size)
    else:
        sampler = qmc.Sobol(len(drawn), scramble=True, rng=rng)
        power = size.bit_length() - (size & (size - 1) == 0)  # random() warns of other sizes
        shares = sampler.random_base2(power)[:size]
    for row in np.clip(shares, EDGE, 1.0 - EDGE):
        yield {name: _drawn(axis, float(u)) for (name, axis), u in zip(drawn.items(), row, strict=True)}


def _drawn(axis: CampaignAxis, share: float) -> tuple[Any, Any]:
    """The value of an axis below which this share of its distribution lies."""
    if axis.uniform is not None:
        low, high = axis.uniform
        value = low + share * (high - low)
    elif axis.normal is not None:
        mean, std = axis.normal
        value = mean + std * NormalDist().inv_cdf(share)
    elif axis.log_uniform is not None:
        low, high = axis.log_uniform
        value = low * (high / low) ** share
    else:  # a category: as many strata as there are values
        choices = _choices(axis)
        return choices[int(share * len(choices))]
    return value, value
