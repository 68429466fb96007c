"""Numbers of the shipped ships whose source is a formula, computed anew."""

from math import pi, radians, sqrt

import numpy as np
import pytest
from support.ships import SHIPS

GRAVITY, TURN = 9.81, 2.0 * pi


def numbers(name):
    """The numbers of a ship's file by name, those of parts with the name of the part."""
    d = SHIPS[name]
    found = {v.name: v.value for v in (*d.inertia, *d.terms)}
    return found | {
        f"{p.name}.{v.name}": v.value for p in (*d.functions, *d.actuators) for v in p.values
    }


def otter():
    """The model of the MSS toolbox with its payload of 25 kg at 0.05 m, in the plane."""
    hull, payload, length, beam, block = 55.0, 25.0, 2.0, 0.25, 0.4
    m = hull + payload
    x_g = (hull * 0.2 + payload * 0.05) / m
    I_g = hull * (0.25 * length) ** 2 + hull * x_g**2 + payload * 0.05**2
    I_z, N_rdot = I_g + m * x_g**2, -1.7 * I_g
    draft = m / 1025.0 / (2.0 * block * beam * length)
    # Hoerner's curve between the two nodes about beam over twice the draft.
    drag = np.interp(beam / (2.0 * draft), [0.558473, 0.646401], [1.08356, 0.998631])
    ahead, astern = 0.5 * 0.02216, 0.5 * 0.01289  # N per (rad/s)^2 of one propeller
    each = {
        "k_ahead": ahead * TURN**2,
        "k_astern": astern * TURN**2,
        "n_max": sqrt(0.5 * 24.4 * GRAVITY / ahead) / TURN,
        "n_min": -sqrt(0.5 * 13.6 * GRAVITY / astern) / TURN,
    }
    return {
        "m": m,
        "I_z": I_z,
        "x_g": x_g,
        "X_udot": -0.1 * hull,
        "Y_vdot": -1.5 * hull,
        "N_rdot": N_rdot,
        "X_u": -24.4 * GRAVITY / (6.0 * 0.5144),
        "N_r": -(I_z - N_rdot),
        "N_absr_r": -10.0 * (I_z - N_rdot),
        "N_uv": 1.4 * hull,
        "cross_flow.cross_flow_length": length,
        "cross_flow.cross_flow_draft": draft,
        "cross_flow.cross_flow_drag": drag,
        "port.y": -0.395,
        "starboard.y": 0.395,
        **{f"{side}.{n}": x for side in ("port", "starboard") for n, x in each.items()},
    }


def cybership2():
    """Its tunnel thruster at 2000 rpm, and the lift of a rudder, 6.43306 N per rad and (m/s)^2."""
    n = 2000.0 / 60.0
    each = {"n_max": n, "n_min": -n}
    lift = {f"{side}_rudder.area": 6.43306 / (0.5 * 1014.0 * 2.5) for side in ("port", "starboard")}
    shafts = {f"{side}.{k}": x for side in ("port", "starboard") for k, x in each.items()}
    return {"bow.F": 1.56822e-4 * n * n, **lift, **shafts}


def kvlcc2():
    """Inertia about midship; numbers in prime units over L = 7 m, rho L^2 d / 2 and rho L^4 d / 2."""
    length, mass = 7.0, 0.5 * 1000.0 * 7.0**2 * 0.455
    return {
        "m": 3.27 * 1000.0,
        "I_z": 3270.0 * ((0.2486 * length) ** 2 + 0.2436**2),
        "X_udot": -0.022 * mass,
        "Y_vdot": -0.223 * mass,
        "N_rdot": -0.011 * mass * length**2,
        "N_uv": (0.223 - 0.022) * mass,
        "propeller.x": -0.48 * length,
        "rudder.x": -0.5 * length,
        "rudder.hull_force_place": -0.464 * length,
        "rudder.inflow_lever": -0.710 * length,
    }


def gunnerus():
    """Added mass by shares of the mass, resistance by draft and beam, thrust per (1/min)^2."""
    m, beam, draft = 531000.0, 9.6, 2.786
    A22 = 0.4 * m
    each = {"k_ahead": 2.2 * 60.0**2, "alpha_rate": radians(30.0), "n_rate": 30.0 / 60.0}
    return {
        "I_z": 81.0 * m,
        "X_udot": -0.05 * m,
        "Y_vdot": -A22,
        "Y_rdot": 3.0 * A22,
        "N_vdot": 3.0 * A22,
        "N_rdot": -A22 * (9.0**2 + 3.0**2),
        "resistance.drag_area": draft * beam,
        **{f"azimuth_{side}.{n}": x for side in ("port", "starboard") for n, x in each.items()},
    }


def esso_osaka():
    """Prime units over L = 3 m and rho L^2 d / 2; Fujii's formula, heights and quotients of its rudder."""
    length, mass, ratio = 3.0, 0.5 * 998.0 * 3.0**2 * 0.20114, 1.539
    m, x_g = 0.27078 * mass, 0.03119 * length
    I_z = m * ((0.25 * length) ** 2 + x_g**2)
    return {
        "m": m,
        "x_g": x_g,
        "I_z": I_z,
        "X_udot": -0.0467 * mass,
        "Y_vdot": -0.2579 * mass,
        "N_rdot": I_z - (0.0286 * mass * length**2 + m * x_g**2),
        "N_uv": (0.2579 - 0.0467) * mass,
        "propeller.x": -0.517 * length,
        "propeller.pitch": 0.7151 * 0.084,
        "rudder.x": -0.5 * length,
        "rudder.span": sqrt(0.01063 * ratio),
        "rudder.lift": 6.13 * ratio / (2.25 + ratio),
        "rudder.race": 0.288 / 1.42,
        "rudder.hull_force_place": -0.45 * length,
        "rudder.inflow_lever": -1.08 * length,
    }


SOURCES = [otter, cybership2, kvlcc2, gunnerus, esso_osaka]


@pytest.mark.parametrize("source", SOURCES, ids=lambda f: f.__name__)
def test_numbers_of_a_file_are_those_of_its_source(source):
    """To the digits that a file has; those of a model ship's thruster speed are guessed to three."""
    given = numbers(source.__name__)
    for name, expected in source().items():
        assert given[name] == pytest.approx(expected, rel=2e-3 if name.startswith("bow") else 1.1e-3), (
            name
        )


def test_numbers_of_the_otter_have_four_digits():
    given = numbers("otter")
    for name, expected in otter().items():
        assert given[name] == pytest.approx(expected, rel=3e-4), name
