"""SYSID4 of Table 7.1: what the thesis identified as the error of its model of the real ship.

The surge coefficients add to g(nu); those of sway and yaw are totals, so what the plant gets is the
entry minus Table 2.1 (corrected). The losses are parts of the requested force, (7.6).
"""

from fmus.hull import RotationalDamping

SURGE = {"X_absu_u": -0.26, "X_u": -3.5, "X_absu_r": 0.2}
ROTATIONAL = RotationalDamping(
    Y_absr_v=-0.014,
    Y_r=1.55,
    Y_absv_r=0.017,
    Y_absr_r=0.2,
    N_absr_v=0.017,
    N_r=-1.8,
    N_absv_r=-0.02,
    N_absr_r=-0.2,
)
LOSSES = {"surge": 0.3, "sway": 0.0, "yaw": 0.31}

# The truth in the order of the coefficients that the improved controller estimates, (7.2) and (7.5).
PHI = (*SURGE.values(), *ROTATIONAL, *LOSSES.values())


def parameters() -> dict[str, float]:
    """``instance.parameter`` -> value, for the plant of a scenario."""
    table = RotationalDamping()
    added = SURGE | {k: x - getattr(table, k) for k, x in ROTATIONAL._asdict().items()}
    return {f"vessel.delta_{k}": x for k, x in added.items()} | {
        f"thrusters.loss_{k}": x for k, x in LOSSES.items()
    }
