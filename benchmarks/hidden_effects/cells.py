"""The cells of the benchmark: what is hidden, under which noise, in a ship of which coefficients."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np

from .draw import NOISY, OUTAGES, SINGLE, UNKNOWN

NONE = "none"
NONES = 5  # cells without an effect, for each noise, kind of coefficients and seed
FIRST_FOR_FITTING = 50  # seeds from here on are for fitting the calibration, those below are shown
# Two effects at once: ten on different axes, ten on one. Whether they are separable is computed.
PAIRS = (
    ("X_u", "N_r"),
    ("loss_surge", "Y_v"),
    ("N_v", "X_uu"),
    ("Y_ur", "loss_yaw"),
    ("current", "N_|r|r"),
    ("mass", "N_uv"),
    ("bow_failure", "X_|u|r"),
    ("body_bias", "Y_|r|v"),
    ("heading_offset", "X_u"),
    ("thrust_curve", "N_ur"),
    ("X_u", "X_rr"),
    ("loss_surge", "X_uu"),
    ("Y_v", "Y_ur"),
    ("Y_r", "Y_uv"),
    ("N_r", "N_uv"),
    ("N_v", "loss_yaw"),
    ("X_vv", "mass"),
    ("Y_|r|v", "loss_sway"),
    ("N_|v|v", "bow_speed_loss"),
    ("X_vr", "curve_vsp_x(c)"),
)
KINDS = ("single", "none", "pair", "foreign", "outages", "process noise")
Key = tuple[str, str, str, int]


@dataclass(frozen=True)
class Cell:
    """One problem of the benchmark.

    Attributes:
        effects: ids of what is hidden; none, one or two.
        noise: n1, n4 or n10.
        wrong: whether the plant's coefficients are up to 10 % off the nominal ones.
        seed: of all that is drawn.
    """

    effects: tuple[str, ...]
    noise: str
    wrong: bool
    seed: int

    @property
    def name(self) -> str:
        return " + ".join(self.effects) or NONE

    @property
    def key(self) -> Key:
        return self.name, self.noise, "wrong" if self.wrong else "exact", self.seed

    def rng(self, purpose: int) -> np.random.Generator:
        """Random numbers that are the same for all noises."""
        name = int.from_bytes(self.name.encode(), "little") % 2**63
        return np.random.default_rng([self.seed, purpose, self.wrong, name])


def cells(
    kinds: Sequence[str],
    effects: Sequence[str],
    noises: Sequence[str],
    wrong: Sequence[bool],
    seeds: Sequence[int],
) -> Iterator[Cell]:
    """The cells of a benchmark.

    Args:
        kinds: some of :data:`KINDS`.
        effects: single ones that are hidden.
        noises: levels of noise.
        wrong: kinds of coefficients.
        seeds: of everything that is drawn.
    """
    hidden: dict[str, Sequence[tuple[str, ...]]] = {
        "single": [(e,) for e in effects],
        "none": [()],
        "pair": list(PAIRS),
        "foreign": [(e,) for e in UNKNOWN],
        "outages": [(e,) for e in OUTAGES],
        "process noise": [(e,) for e in NOISY],
    }
    for seed, (noise, off), kind in product(seeds, product(noises, wrong), kinds):
        # The manoeuvres are those of the seed; where nothing is hidden, all else is drawn anew.
        again = [seed + 100 * k for k in range(NONES)] if kind == "none" else [seed]
        for each in again:
            yield from (Cell(chosen, noise, off, each) for chosen in hidden[kind])


def kind_of(name: str) -> str:
    """The kind of a cell with this name."""
    if name == NONE:
        return "none"
    if name in OUTAGES:
        return "outages"
    if name in NOISY:
        return "process noise"
    return "pair" if " + " in name else "foreign" if name in UNKNOWN else "single"


def for_fitting(name: str, seed: int) -> bool:
    """Whether a cell may serve to fit the calibration of confidences; if not, it may be shown.

    Every second effect, pair and foreign kind is for fitting, and seeds from 50 on. A cell of the other
    seeds with one of these effects, or the reverse, is neither.
    """
    return seed % 100 >= FIRST_FOR_FITTING and _even(name)


def for_showing(name: str, seed: int) -> bool:
    """Whether a cell may be shown in the reliability diagram: other seeds and other effects."""
    return seed % 100 < FIRST_FOR_FITTING and (name == NONE or not _even(name))


def _even(name: str) -> bool:
    names = {"single": SINGLE, "pair": [" + ".join(pair) for pair in PAIRS], "foreign": UNKNOWN}
    names |= {"outages": OUTAGES, "process noise": NOISY}
    kind = kind_of(name)
    return kind == "none" or names[kind].index(name) % 2 == 0
