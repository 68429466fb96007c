"""A model of ship and thrusters on measured runs: parameters, forces, predictions, model error."""

from .parameter_set import read_model, write_model
from .ship_model import Model
from .thrust import Response
from .weak_form import Integrals, integrals, omega

__all__ = ["Integrals", "Model", "Response", "integrals", "omega", "read_model", "write_model"]
