"""A run as a table and as the file beside it, as :func:`.read` takes them."""

from typing import Any

import pandas as pd

from ..columns.columns import POSE, Column, Layout, read_layout
from .reading import Run

# What the file beside a measurement says of its text, and of columns that have other names now.
OF_TEXT = {"separator", "decimal", "encoding", "skip", "units_line", "columns"}


def table_of(run: Run) -> pd.DataFrame:
    """All that was measured and commanded, by its own names and in SI."""
    pose = dict(zip(POSE, run.pose.T, strict=True))
    return pd.DataFrame({"time": run.time, **pose, **run.commanded, **run.measured})


def layout_beside(run: Run) -> dict[str, Any]:
    """What the file beside that table says: noise, and what the one beside the run's own file said."""
    path = run.file
    before = read_layout(path) if path is not None and not path.is_dir() else None
    kept = (before or Layout()).model_dump(exclude_defaults=True, exclude=OF_TEXT)
    columns = {name: Column(name=name, noise=std) for name, std in run.noise.items()}
    return kept | Layout(columns=columns).model_dump(exclude_defaults=True)
