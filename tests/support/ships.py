"""Described ships as tests need them."""

from collections.abc import Mapping

from fmus.actuators.actuation import actuators
from fmus.controller import heading
from fmus.declare import Component, variables
from fmus.ship import ship
from fmus.ship_description import Description, Part, Value
from fmus.ships.ship_file import find_ship, read_ship, shipped_ships
from fmus.ships.wind import described_numbers


def part(name: str, law: str, values: Mapping[str, float]) -> Part:
    """An actuator, or a function of a hull, with some numbers."""
    return Part(name, law, name, tuple(Value(key, x, "guessed", 0.5) for key, x in values.items()))


def described(
    *parts: Part, terms: Mapping[str, float] | None = None, functions: tuple[Part, ...] = ()
) -> Description:
    """A ship of 2 m with these actuators and damping coefficients."""
    inertia = {"m": 50.0, "I_z": 20.0, "X_udot": -5.0, "Y_vdot": -30.0, "N_rdot": -10.0}
    values = tuple(Value(name, x, "guessed", 0.5) for name, x in inertia.items())
    drag = terms or {"X_u": -20.0, "Y_v": -80.0, "N_r": -30.0}
    found = tuple(Value(name, x, "guessed", 0.5) for name, x in drag.items())
    outline = ((1.0, 0.5), (-1.0, 0.5), (-1.0, -0.5))
    return Description("tried", "a ship", "", 2.0, 1.0, outline, values, found, functions, parts)


def scaled(d: Description, ratio: float) -> Description:
    """A ship of another size by Froude's law, number by number."""
    s = ship(description=d)
    at = type(d.scale)(ratio)
    units = {v.name: v.unit for part in (s.vessel, s.thrusters) for v in variables(part.params)}

    def of(values, unit_of):
        return tuple(Value(v.name, v.value * at.factor(unit_of(v.name)), *v[2:]) for v in values)

    def of_actuator(a, name):
        command = next((c for c in a.law.commands if name == f"{c.name}_rate"), None)
        if command is not None:
            return {"1": "1/s", "1/s": "1/s2"}.get(command.unit, f"{command.unit}/s")
        placed = {"lag": "s", "half_spacing": "m"}
        return placed[name] if name in placed else units[d.called(f"{a.part.name}_{name}")]

    in_wind = {v.name: v.unit for v in described_numbers([v.name for v in d.wind])}
    return d._replace(
        length=d.length * ratio,
        beam=d.beam * ratio,
        inertia=of(d.inertia, units.__getitem__),
        terms=of(d.terms, units.__getitem__),
        functions=tuple(f._replace(values=of(f.values, units.__getitem__)) for f in d.functions),
        actuators=tuple(
            a.part._replace(values=of(a.part.values, lambda name, a=a: of_actuator(a, name)))
            for a in actuators(d)
        ),
        wind=of(d.wind, in_wind.__getitem__),
    )


PROPELLER = {"k_ahead": 0.5, "k_astern": 0.3, "n_max": 10.0, "n_min": -9.0}
OPEN_WATER = {
    "diameter": 0.2, "K_T0": 0.4, "K_T1": -0.3, "K_T2": -0.1, "wake": 0.2, "thrust_deduction": 0.1,
    "astern": 0.7, "n_max": 12.0, "n_min": -8.0,
}  # fmt: skip
AZIMUTH = {"k_ahead": 0.5, "k_astern": 0.3, "n_max": 10.0}
LEG = {**AZIMUTH, "area": 0.02, "drag": 0.3, "drag_slope": 0.3, "lift": 0.5}
RACE_RUDDER = {"area": 0.02, "span": 0.25, "hull_force": 0.2, "gamma_minus": 0.6, "inflow_lever": -1.0}
# A dead band astern, and more force ahead.
TABLE = {
    f"F_{k}": f for k, f in enumerate((-3.0, -2.0, -1.0, -0.2, -0.1, 0.0, 0.8, 2.0, 3.5, 4.5, 5.0), 1)
}
# Every law that is asked for force, in one ship.
EVERY_LAW = described(
    part("port", "fixed_propeller", {**PROPELLER, "x": -1.0, "y": -0.4}),
    part("starboard", "open_water_propeller", {**OPEN_WATER, "x": -1.0, "y": 0.4, "n_rate": 5.0}),
    part("rudder", "rudder", {"x": -1.1, "area": 0.02, "hull_force": 0.2, "lag": 0.5}),
    part("pod", "azimuth", {**AZIMUTH, "x": -0.8}),
    part("bow", "tunnel_thruster", {"x": 0.8, "F": 6.0}),
    part("vsp", "voith_schneider", {"x": 0.2, "F": 9.0}),
    part("jet", "force_table_surge", {**TABLE, "x": -0.9, "y": 0.1}),
    part("stern", "force_table_sway", {**TABLE, "x": -0.9}),
    part("square", "squared_tunnel_thruster", {"x": 0.7, "F": 2.0}),
    part("squares", "squared_voith_schneider", {"x": 0.1, "F": 3.0}),
    part("tabled", "tabulated_tunnel_thruster", {"x": 0.6, "F": 2.0}),
    part("tables", "tabulated_voith_schneider", {"x": -0.1, "F": 3.0}),
    part("tug", "given_force", {"F_X": 5.0, "F_Y": 7.0, "x": 0.9}),
    terms={"X_absu_u": -20.0, "Y_absu_v": -80.0, "N_uuv": -3.0, "N_r": -30.0, "Y_vvr": -1.0},
    functions=(part("cross_flow", "cross_flow", {"cross_flow_length": 2.0}),),
)
# Laws that get commands: a rudder in a race, and two thrusters with the same commands.
COMMANDED = described(
    part("screw", "propeller_behind_hull", {**OPEN_WATER, "x": -1.0, "C_2_plus": 1.6}),
    part("flap", "rudder_in_race", {**RACE_RUDDER, "x": -1.1})._replace(behind="screw"),
    part("leg", "azimuth_with_leg", {**LEG, "x": -0.7, "y": 0.3, "lag": 0.5})._replace(order="legs"),
    part("other_leg", "azimuth_with_leg", {**LEG, "x": -0.7, "y": -0.3})._replace(order="legs"),
    functions=(part("resistance", "resistance", {"drag_in_drift": 0.2}),),
)._replace(allocates=False, wind=(Value("lateral_area", 2.0, "guessed", 0.5),))
SHIPS = {name: read_ship(find_ship(name)) for name in shipped_ships()} | {
    "every_law": EVERY_LAW,
    "commanded": COMMANDED,
}
COMMANDED_SHIPS = [name for name, d in SHIPS.items() if not d.allocates]
PARTS = [f"{name} {part}" for name in SHIPS for part in ("vessel", "thrusters")]
PARTS += [f"{name} autopilot" for name in COMMANDED_SHIPS]


def component(name: str) -> Component:
    """One of :data:`PARTS`, such as ``otter vessel``."""
    of, which = name.split()
    if which == "autopilot":
        autopilot = heading.make(ship().effects, SHIPS[of])
        assert autopilot is not None
        return autopilot
    return getattr(ship(description=SHIPS[of]), which)
