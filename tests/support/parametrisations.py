"""The parametrisations of the thesis, by names for the tests."""

from fmus.controller.models import ALL_UNKNOWN, ROTATIONAL, SCALED, SURGE, SURGE_DAMPING

PARAMETRISATIONS = {
    "rotational": ROTATIONAL,
    "surge": SURGE,
    "surge damping": SURGE_DAMPING,
    "all": ALL_UNKNOWN,
    "scaled": SCALED,
}
