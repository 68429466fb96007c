"""All rules; importing this registers them."""

from . import (  # noqa: F401
    archive,
    dependencies,
    life,
    state,
    structure,
    tools,
    units,
    values,
    variables,
)
