"""What no ship has: damping that drives it on, negative added mass, actuators outside, other sizes.

And numbers that a file does not state although every ship has its own.
"""

import re
from collections.abc import Iterator, Sequence
from math import pi, sqrt
from typing import NamedTuple

from ..actuators.law import Flow, Law
from ..declare import Variable, parameters_of, variables
from ..hull import term, term_force, term_variable
from ..hull_functions import FUNCTIONS
from ..ship_description import Description, Part, Value
from .wind import described_numbers

G = 9.81  # m/s2
SEA_WATER = 1025.0  # kg/m3, where the file has no density
# Speeds at which the damping of products is looked at, over sqrt(g L), rates over sqrt(g / L): from far
# below to far above all that ships reach, where the lowest and the highest power decide (chosen).
FROUDE_NUMBERS = [10.0 ** (k / 6.0) for k in range(-18, 19)]
AHEAD, ASIDE = 0.2, 0.02  # those of other functions: a usual speed, and a little drift on it (chosen)
# 1, of the mass of water of length x beam x beam: a twentieth of that of the lightest shipped ship, a
# catamaran (chosen). A mass in tonnes is a thousandth.
LIGHTEST = 0.0017
# 1, radius of gyration in lengths: half of a rod's, and that of a mass at both ends (chosen).
GYRATION = 0.14, 0.5
GIVEN_FORCE = "given_force"  # law of a force that no device limits
OVERHANG = 0.05  # of length and beam: outboard motors and rudders hang behind the outline (chosen)
MOTIONS = ("surge", "sway", "yaw")
COMMON = ("1", "rad", "1/rad", "kg/m3")  # units of numbers of which a usual one serves for any ship


class ShipDoubt(NamedTuple):
    """A number that is none of a ship.

    Attributes:
        header: of the table of the file in which it stands; of a term "product".
        place: number of that table or term among its like.
        key: of the number; empty: the whole table.
        text: what is wrong.
    """

    header: str
    place: int
    key: str
    text: str


def doubts(ship: Description, draft: float | None = None) -> Iterator[ShipDoubt]:
    """Numbers of a description that no ship has.

    Args:
        ship: the description.
        draft: [m]; None: that of a function of its hull, if it has one.
    """
    yield from _inertia(ship, draft)
    yield from _sizes(ship)
    yield from _products(ship)
    yield from _functions(ship)
    for k, part in enumerate(ship.actuators):
        yield from _place(ship, k, part)
        yield from _angles(k, part)
        if assumed := _assumed(part.values, variables(Law.known[part.law].Parameters)):
            text = f"actuator '{part.name}' does not state all of its numbers; assumed: {assumed}"
            yield ShipDoubt("actuators", k, "", text)
    stated = {v.name: v.value for v in ship.wind}
    if stated and (assumed := _assumed(ship.wind, described_numbers(stated))):
        yield ShipDoubt("wind", 0, "", f"wind does not state all of its numbers; assumed: {assumed}")


def _assumed(stated: Sequence[Value], needed: Sequence[Variable]) -> str:
    """Numbers with their units that are not stated, and of which every ship has its own; empty: none."""
    names = {v.name for v in stated}
    left = [v for v in needed if v.name not in names and v.start and v.unit not in COMMON]
    return ", ".join(f"{v.name} = {v.start:.4g} {v.unit}" for v in left)


def _inertia(ship: Description, draft: float | None) -> Iterator[ShipDoubt]:
    values = ship.values()
    for name, motion in zip(("X_udot", "Y_vdot", "N_rdot"), MOTIONS, strict=True):
        if name in values and values[name].value > 0.0:
            unit = "kg.m2" if motion == "yaw" else "kg"
            text = f"is positive; the added mass in {motion} needs a negative {name}"
            yield ShipDoubt("inertia", 0, name, f"{name} = {values[name].value:.4g} {unit} {text}")
    numbers = {v.name.rpartition("_")[2]: v.value for part in ship.functions for v in part.values}
    draft = draft or numbers.get("draft")
    if draft is None:
        return
    box = numbers.get("density", SEA_WATER) * ship.length * ship.beam * draft
    if (m := values["m"].value) > box:
        size = f"{ship.length:g} m x {ship.beam:g} m x {draft:g} m"
        text = f"more than a box of length x beam x draft, {size}, displaces: {box:.4g} kg"
        yield ShipDoubt("inertia", 0, "m", f"m = {m:.4g} kg is {text}")


def _sizes(ship: Description) -> Iterator[ShipDoubt]:
    """Mass, inertia and thrust that are far from those of a ship of such a length and beam."""
    length, beam, values = ship.length, ship.beam, ship.values()
    m, turned = values["m"].value, values["I_z"].value
    if beam > length:
        yield ShipDoubt("", 0, "beam", f"beam = {beam:g} m is more than the length, {length:g} m")
    water = SEA_WATER * length * beam * beam
    if not LIGHTEST * water <= m <= water:
        usual = f"ships of {length:g} m x {beam:g} m have {LIGHTEST * water:.2g} to {water:.2g} kg"
        yield ShipDoubt("inertia", 0, "m", f"m = {m:.4g} kg; {usual}")
        return
    if not GYRATION[0] <= (k := sqrt(turned / m) / length) <= GYRATION[1]:
        usual = f"ships have {GYRATION[0]:g} to {GYRATION[1]:g}, most of them 0.25"
        text = f"I_z = {turned:.4g} kg.m2 is a radius of gyration of {k:.2g} lengths; {usual}"
        yield ShipDoubt("inertia", 0, "I_z", text)
    if ship.actuators and not (ship.terms or ship.functions):
        yield ShipDoubt("hull", 0, "", "the hull has no damping: what moves never stops")
    weight = m * G
    for k, part in enumerate(ship.actuators):
        if (thrust := max(map(abs, _reach(part)), default=0.0)) > weight:
            more = f"gives {thrust:.3g} N, more than the ship's weight, {weight:.3g} N"
            key = "n_max" if part.stated("n_max") else ""
            yield ShipDoubt("actuators", k, key, f"actuator '{part.name}' {more}")


def _reach(part: Part) -> Iterator[float]:
    """Lowest and highest forces [N] of an actuator at rest, on each axis of which it can be asked."""
    law = Law.known[part.law]
    if law.components and part.law != GIVEN_FORCE:
        numbers = {v.name: v.value for v in part.values if v.name in law.Parameters._fields}
        for low, high in law.reach(Flow(), law.Parameters(**numbers)):
            yield from (float(low), float(high))


def _angles(k: int, part: Part) -> Iterator[ShipDoubt]:
    """Largest angles of an actuator that are of more than two turns."""
    law = Law.known[part.law]
    for v in variables(law.Parameters):
        stated = part.stated(v.name)
        if v.unit == "rad" and v.name.endswith("_max") and stated and stated.value > 4.0 * pi:
            text = f"actuator '{part.name}': {v.name} = {stated.value:g} rad is more than two turns"
            yield ShipDoubt("actuators", k, v.name, f"{text}; is it in degrees?")


def _products(ship: Description) -> Iterator[ShipDoubt]:
    """Products of one speed alone that drive the ship along with it at some speed, ahead or astern."""
    names = [v.name for v in ship.terms]
    for axis, motion in enumerate(MOTIONS):
        own = [
            v
            for v in ship.terms
            if term(v.name)[0] == axis and {k for _, k in term(v.name)[1]} == {axis}
        ]
        unit = _unit_of_speed(ship, axis)
        for speed in (side * x * unit for x in FROUDE_NUMBERS for side in (1.0, -1.0)):
            push = [term_force(v.name, v.value, *_along(axis, speed))[axis] * speed for v in own]
            if sum(push) > 0.0:
                worst = own[push.index(max(push))]
                value = f"{worst.name} = {worst.value:.4g} {term_variable(worst.name).unit}"
                yield ShipDoubt(
                    "product",
                    names.index(worst.name),
                    "product",
                    f"{value} adds energy at {_told(axis, speed)} in {motion}; damping removes energy",
                )
                break


def _functions(ship: Description) -> Iterator[ShipDoubt]:
    """Other functions of the hull that drive the ship along with a speed, or lack numbers."""
    for part in ship.functions:
        needed = parameters_of(part.law, 3, FUNCTIONS[part.law])
        if assumed := _assumed(part.values, needed):
            text = f"{part.law} does not state all of its numbers; assumed: {assumed}"
            yield ShipDoubt(f"hull.functions.{part.law}", 0, "", text)
        names = [v.name for v in needed]
        numbers = {v.name: v.value for v in part.values if v.name in names}
        for axis, motion in enumerate(MOTIONS):
            base = AHEAD * _unit_of_speed(ship, 0) if axis else 0.0
            size = (ASIDE if axis else AHEAD) * _unit_of_speed(ship, axis)
            for speed in (size, -size):
                u, v, r = _along(axis, speed)
                with_it = FUNCTIONS[part.law](u + base, v, r, **numbers)
                without = FUNCTIONS[part.law](base, 0.0, 0.0, **numbers)
                if (with_it[axis] - without[axis]) * speed > 0.0:
                    text = f"{part.law} adds energy at {_told(axis, speed)} in {motion}"
                    yield ShipDoubt(
                        f"hull.functions.{part.law}", 0, "", f"{text}; damping removes energy"
                    )
                    break


def _unit_of_speed(ship: Description, axis: int) -> float:
    """That of Froude number 1 [m/s or rad/s]."""
    return sqrt(G / ship.length) if axis == 2 else sqrt(G * ship.length)


def _along(axis: int, speed: float) -> tuple[float, float, float]:
    u, v, r = (speed if k == axis else 0.0 for k in range(3))
    return u, v, r


def _told(axis: int, speed: float) -> str:
    return f"{speed:.2g} {'rad/s' if axis == 2 else 'm/s'}"


def _place(ship: Description, k: int, part: Part) -> Iterator[ShipDoubt]:
    """An actuator outside of the outline."""
    apart = part.number("half_spacing")
    for j, (name, room, sides) in enumerate(
        (("x", ship.length, (0.0,)), ("y", ship.beam, (-apart, apart)))
    ):
        corners = [corner[j] for corner in ship.outline]
        low, high = min(corners), max(corners)
        at = part.number(name)
        if any(not low - OVERHANG * room <= at + side <= high + OVERHANG * room for side in sides):
            text = f"{name} = {at:.4g} m, outside of the outline, {low:.4g} to {high:.4g} m"
            yield ShipDoubt("actuators", k, name, f"actuator '{part.name}' is at {text}")


def line_of(doubt: ShipDoubt, text: str) -> int | None:
    """The line of a ship's file in which a doubtful number stands; None: it is not found."""
    lines = [line.partition("#")[0] for line in text.splitlines()]
    if doubt.header == "product":
        found = [k for k, line in enumerate(lines, 1) for _ in re.findall(r"\bproduct\s*=", line)]
        return found[doubt.place] if doubt.place < len(found) else None
    if not doubt.header:  # above all tables
        found = [k for k, line in enumerate(lines, 1) if re.match(rf"\s*{doubt.key}\s*=", line)]
        return found[0] if found else None
    header = re.compile(rf"\s*\[+\s*{re.escape(doubt.header)}\s*\]")
    heads = [k for k, line in enumerate(lines) if header.match(line)]
    if doubt.place >= len(heads):
        return None
    first = heads[doubt.place]
    for k, line in enumerate(lines[first + 1 :], first + 2):
        if line.lstrip().startswith("["):
            break
        if doubt.key and re.match(rf"\s*{re.escape(doubt.key)}\s*=", line):
            return k
    return first + 1
