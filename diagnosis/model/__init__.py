"""A model of ship and thrusters on measured runs: parameters, forces, predictions, model error."""

from .parameter_set import read_model, ship_with, write_model
from .ship_model import Model, of_one_run, of_run
from .thrust import Response
from .weak_form import Integrals, integrals, omega, told_apart

__all__ = [
    "Integrals",
    "Model",
    "Response",
    "integrals",
    "of_one_run",
    "of_run",
    "omega",
    "read_model",
    "ship_with",
    "told_apart",
    "write_model",
]
