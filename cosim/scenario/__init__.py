"""The user's input: scenario files, and their checks that need no FMU."""

from ..lazy import lazy_names

TYPE_CHECKING = False  # typing itself takes a while to import
if TYPE_CHECKING:
    from .load import load_scenario, with_settings
    from .roles import Roles
    from .schema import Scenario, json_schema

__all__ = ["Roles", "Scenario", "json_schema", "load_scenario", "with_settings"]

__getattr__ = lazy_names(
    __name__,
    {
        "Roles": "roles",
        "Scenario": "schema",
        "json_schema": "schema",
        "load_scenario": "load",
        "with_settings": "load",
    },
)
