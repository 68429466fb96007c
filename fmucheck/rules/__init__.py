"""All rules; importing this registers them."""

from . import (  # noqa: F401
    archive,
    dependencies,
    header,
    life,
    state,
    structure,
    tools,
    types,
    units,
    values,
    variables,
)
