"""The sentence of each effect of the registry."""

from math import degrees, hypot

import numpy as np

from fmus.declare import variables
from fmus.effects import EFFECTS, Ship
from fmus.hull import Damping

from .telling import REGISTRY, SIDES, Told, capital, compass, number, percent, says, towards

DRAG = {"X": ("u", "surge drag"), "Y": ("v", "sway drag"), "N": ("r", "resistance to turning")}
MOTION = {
    "u": "Going ahead",
    "v": "Drifting sideways",
    "r": "Turning",
    "uv": "Drifting sideways while going ahead",
    "ru": "Turning while going ahead",
    "rv": "Turning while drifting sideways",
}


def _damping(t: Told) -> str:
    """A damping-like term, as a force at the speeds that the ship reached."""
    axis, _, product = t.effect.id.partition("_")
    moved = "".join(sorted(set(product) - {"|"}))
    force = _force(t)
    unit = "N m" if axis == "N" else "N"
    own, drag = DRAG[axis]
    if moved == own and product != "uu":
        sense = "more" if force < 0.0 else "less"
        at = _at(moved, t.speeds)
        return f"The ship has {sense} {drag} than the model believes: {number(force)} {unit} at {at}."
    effect = towards(force, unit, axis)
    at = _at(moved, t.speeds, sides=True)
    what = "a moment" if axis == "N" else "a force"
    return f"{MOTION[moved]} gives {what} that the model does not know: {effect} at {at}."


def _force(t: Told) -> float:
    """Force or moment of a damping-like term at the ship's speeds, all positive."""
    assert t.effect.function is not None
    u, v, r = t.speeds
    given = t.effect.function(Ship(u=u, v=v, r=r), *t.values.values())
    return float(given["XYN".index(t.effect.axis)])


def _at(moved: str, speeds: tuple[float, float, float], sides: bool = False) -> str:
    """The speeds that count, such as ``0.1 m/s ahead and 6°/s to starboard``."""
    u, v, r = speeds
    parts = {"u": (f"{u:.2g} m/s", "ahead"), "v": (f"{v:.2g} m/s", "to starboard")}
    parts["r"] = (f"{degrees(r):.2g}°/s", "to starboard")
    return " and ".join(" ".join(parts[m][: 1 + sides]) for m in "uvr" if m in moved)


_CHANGES = {f"delta_{v.name}" for v in variables(Damping)}
for _e in EFFECTS.values():
    if _e.coefficients and _e.coefficients[0] in _CHANGES:
        REGISTRY[_e.id] = _damping


def _peak(t: Told) -> tuple[float, float]:
    """Where a curve is furthest from zero, as a share of its way from the first node, and its value."""
    names = list(t.effect.coefficients)
    nodes = np.array([t[name] for name in names])
    k = int(np.abs(nodes).argmax())
    return k / (len(names) - 1), float(nodes[k])


def _reach(t: Told) -> float:
    """The range of a curve's nodes."""
    (setting,) = (p for p in t.effect.parameters if p.name in t.effect.settings)
    return setting.start + t[setting.name]


@says("curve_X(u)")
def _(t: Told) -> str:
    place, value = _peak(t)
    at = (2.0 * place - 1.0) * _reach(t)
    return (
        "The surge force follows another curve over the speed than the model's: "
        f"{towards(value, 'N', 'X')} is missing at {at:.2g} m/s."
    )


@says("curve_vsp_x(c)")
def _(t: Told) -> str:
    return _pushes(t, "X")


@says("curve_vsp_y(c)")
def _(t: Told) -> str:
    return _pushes(t, "Y")


def _pushes(t: Told, axis: str) -> str:
    place, value = _peak(t)
    at = (2.0 * place - 1.0) * _reach(t)
    way = {"X": "push", "Y": "push aside"}[axis]
    return (
        f"The propellers {way} by another curve over their command than the model's: "
        f"{towards(value, 'N', axis)} is missing at command {at:.2g}."
    )


@says("curve_bow(|u|)")
def _(t: Told) -> str:
    place, value = _peak(t)
    sense = "less" if value < 0.0 else "more"
    return (
        "The bow thruster's force changes with the speed: "
        f"{percent(value)} {sense} than the model believes at {place * _reach(t):.2g} m/s."
    )


@says("mass")
def _(t: Told) -> str:
    sense = "more" if t["mass"] > 0.0 else "less"
    return f"The ship has {number(t['mass'])} kg {sense} mass than the model believes."


def _water(name: str, how: str, unit: str) -> None:
    @says(name)
    def _(t: Told) -> str:
        sense = "More" if t[name] > 0.0 else "Less"
        size = f"{number(t[name])} {unit}"
        return f"{sense} water moves with the ship in {how} than the model believes: {size}."


_water("added_mass_X", "surge", "kg")
_water("added_mass_Y", "sway", "kg")
_water("added_mass_N", "yaw", "kg m2")


def _lost(name: str, less: str, more: str) -> None:
    """A share that is lost, or gained where it is negative."""

    @says(name)
    def _(t: Told) -> str:
        return (less if t[name] > 0.0 else more).format(percent(t[name]))


for _name, _who in (("loss_vsp", "propellers give"), ("loss_bow", "bow thruster gives")):
    _lost(
        _name,
        f"The {_who} {{}} less force than the model believes.",
        f"The {_who} {{}} more force than the model believes.",
    )
for _name, _what in (("surge", "surge force"), ("sway", "sway force"), ("yaw", "yaw moment")):
    _lost(
        f"loss_{_name}",
        f"Of the commanded {_what} {{}} do not arrive.",
        f"The {_what} is {{}} larger than commanded.",
    )


@says("thrust_curve")
def _(t: Told) -> str:
    change = {way: t[f"thrust_curve_{way}"] for way in SIDES["X"]}
    parts = [f"{percent(x)} {'more' if x > 0.0 else 'less'} {way}" for way, x in change.items() if x]
    push = f"push {' and '.join(parts)} than the model believes" if parts else ""
    dead = t["thrust_curve_deadband"]
    still = f"do nothing at commands below {percent(dead)}" if dead else ""
    return f"The propellers {' and '.join(filter(None, (push, still)))}."


@says("bow_speed_loss")
def _(t: Told) -> str:
    u = t.speeds[0]
    gone = min(1.0, t["bow_speed_loss"] * u)
    return f"The bow thruster loses force with the speed: {percent(gone)} of it at {u:.2g} m/s."


@says("bow_failure")
def _(t: Told) -> str:
    return f"The bow thruster is dead from t = {number(t['bow_failure_time'])} s on."


@says("deadband")
def _(t: Told) -> str:
    d = number(t["deadband"])
    return f"Each thruster gives nothing below {d} N, and {d} N less above."


@says("saturation")
def _(t: Told) -> str:
    who = {"saturation_vsp": "propellers give", "saturation_bow": "bow thruster gives"}
    parts = [f"the {who[name]} at most {number(x)} N" for name, x in t.values.items() if x]
    return capital(f"{' and '.join(parts)}, whatever is commanded.")


@says("attack_point")
def _(t: Told) -> str:
    return f"The thrust acts {_offset(t, 'attack_point')} of where the model believes."


@says("marker_offset")
def _(t: Told) -> str:
    return f"The position is measured {_offset(t, 'marker_offset')} of where the model believes."


def _offset(t: Told, name: str) -> str:
    ways = (towards(100.0 * t[f"{name}_dx"], "cm", "X"), towards(100.0 * t[f"{name}_dy"], "cm", "Y"))
    return " and ".join(ways)


@says("lag")
def _(t: Told) -> str:
    return f"The thrusters follow their commands slowly, with a time constant of {number(t['lag'])} s."


@says("delay")
def _(t: Told) -> str:
    return f"The thrusters act {number(t['delay'])} s after they are commanded."


@says("earth_force")
def _(t: Told) -> str:
    force = hypot(t["F_n"], t["F_e"])
    way = compass(t["F_n"], t["F_e"])
    return f"A steady force of {number(force)} N pushes the ship towards {way}, as wind would."


@says("body_bias")
def _(t: Told) -> str:
    units = {"X": "N", "Y": "N", "N": "N m"}
    parts = [towards(t[f"body_bias_{a}"], unit, a) for a, unit in units.items() if t[f"body_bias_{a}"]]
    return f"A constant force goes with the ship: {', '.join(parts)}."


@says("current")
def _(t: Told) -> str:
    speed = hypot(t["V_n"], t["V_e"])
    return f"The water moves at {number(speed)} m/s towards {compass(t['V_n'], t['V_e'])}."


@says("waves")
def _(t: Told) -> str:
    peak = t["wave_peak"]
    often = f", with a peak at {number(peak)} rad/s" if peak else ""
    return f"Waves shake the ship{often}."


@says("heading_offset")
def _(t: Told) -> str:
    off = towards(degrees(t["heading_offset"]), "°", "N").replace(" °", "°")
    return f"The heading is measured {off} of the true one."


@says("clock_offset")
def _(t: Told) -> str:
    sense = "older" if t["clock_offset"] > 0.0 else "younger"
    return f"The measured pose is {number(t['clock_offset'])} s {sense} than its time stamp."
