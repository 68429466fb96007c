"""Which rows of a log were measured, where it was filled between slower telegrams by straight lines.

A row between two telegrams lies on the line through its neighbours to rounding, as noise never does;
where a telegram arrived the lines meet, mostly between two rows.
"""

import numpy as np

from ..run_constants import DIGITS, IN_A_ROW, NEGLIGIBLE

# 1, a row is on a line to rounding, which must be less than this share of the distance of the other
# rows. With normal noise in two channels one row in two thousand is then on a line by chance. Chosen.
ON_LINE = 0.03
FEWEST = 0.15  # 1, share of rows on lines from which on a log counts as filled; chosen, far above chance


def filled(time: np.ndarray, position: np.ndarray, step: float = 0.0) -> np.ndarray:
    """(n,): rows that a straight line between two measurements has filled; none in most logs.

    Of the two rows about a telegram the one nearer to it stays.

    Args:
        time: (n,) [s], in order.
        position: (n, k), channels of one receiver, finite.
        step: to which they are rounded.
    """
    none = np.zeros(time.size, bool)
    if time.size < 2 * IN_A_ROW:
        return none
    share = (np.diff(time)[:-1] / (time[2:] - time[:-2]))[:, None]
    off = np.abs(position[1:-1] - position[:-2] - share * (position[2:] - position[:-2])).max(axis=1)
    rounding = (1.0 + NEGLIGIBLE) * max(step, DIGITS * float(np.ptp(position, axis=0).max()))
    on = none.copy()
    on[1:-1] = off <= rounding
    # A long line is a ship's steady motion, unless what is on no line are single kinks.
    too_long = _often(on, IN_A_ROW) and _often(~on[1:-1], 2)  # the rows about a telegram are on no line
    kinks = off[~on[1:-1]]
    if not kinks.size or rounding > ON_LINE * np.median(kinks) or on.mean() < FEWEST or too_long:
        return none
    first = np.flatnonzero(~on & np.concatenate([[True], on[:-1]]))  # of each block of rows on no line
    rows = np.flatnonzero(~on)
    place = rows - first[np.searchsorted(first, rows, side="right") - 1]
    pair = rows[:-1][(place[:-1] % 2 == 0) & (place[1:] == place[:-1] + 1)]
    pair = pair[(pair > 0) & (pair + 2 < time.size)]
    slope = np.diff(position, axis=0) / np.diff(time)[:, None]
    before, after = slope[pair - 1], slope[pair + 1]
    channel = np.abs(before - after).argmax(axis=1)[:, None]
    ahead = position[pair + 1] - position[pair] - after * (time[pair + 1] - time[pair])[:, None]
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):  # of lines that meet at no angle
        kink = np.take_along_axis(ahead, channel, 1) / np.take_along_axis(before - after, channel, 1)
    nearer = kink[:, 0] < 0.5 * (time[pair + 1] - time[pair])
    on[np.where(nearer, pair + 1, pair)] = True
    return on


def _often(mask: np.ndarray, longest: int) -> bool:
    """Whether more than a tenth of the groups of true values (n,) are longer than ``longest``."""
    return bool(np.mean([end - begin > longest for begin, end in groups_of(mask)] or [False]) > 0.1)


def groups_of(mask: np.ndarray) -> list[list[int]]:
    """First index, and the one after the last, of each group of successive true values (n,)."""
    return np.flatnonzero(np.diff(mask, prepend=False, append=False)).reshape(-1, 2).tolist()
