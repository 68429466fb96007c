"""Files of the SSP and OSP standards: parameter sets, variable groups, systems as scenarios."""

from typing import TYPE_CHECKING

from ..lazy import lazy_names

if TYPE_CHECKING:
    from .ssv import Parameter, ParameterSet, read_parameters, write_parameters
    from .systems import is_system, read_system

__all__ = [
    "Parameter",
    "ParameterSet",
    "is_system",
    "read_parameters",
    "read_system",
    "write_parameters",
]

__getattr__ = lazy_names(
    __name__,
    {
        "Parameter": "ssv",
        "ParameterSet": "ssv",
        "is_system": "systems",
        "read_parameters": "ssv",
        "read_system": "systems",
        "write_parameters": "ssv",
    },
)
