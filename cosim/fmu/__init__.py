"""One FMU: its archive and description, and running it, in this process or in one of its own."""

from typing import TYPE_CHECKING

from ..lazy import lazy_names

if TYPE_CHECKING:
    from .fmu_model import Model, Variable
    from .instance import Instance
    from .isolated import IsolatedInstance
    from .local import LocalInstance

__all__ = ["Instance", "IsolatedInstance", "LocalInstance", "Model", "Variable"]

__getattr__ = lazy_names(
    __name__,
    {
        "Instance": "instance",
        "IsolatedInstance": "isolated",
        "LocalInstance": "local",
        "Model": "fmu_model",
        "Variable": "fmu_model",
    },
)
