"""A short ``repr`` of results: small values as they are, of what is large its kind and size."""

from collections.abc import Mapping, Sequence, Sized
from dataclasses import fields
from pathlib import Path
from typing import Any

# 1, names in a sentence, rows of a summary, figures of tracks in a record; of values, of sliders of an
# effect, and of outlines along a track twice as many. Chosen: more are not read.
SHOWN = 4
WIDTH = 80  # 1, characters, of a line of a terminal; the longest value that is shown as it is
PLAIN = (bool, int, float, str, Path, type(None))


class ShortRepr:
    """A dataclass of which a terminal shows a few lines, and never an array."""

    def __repr__(self) -> str:
        names = (f.name for f in fields(self) if f.repr)  # type: ignore[arg-type]
        return f"{type(self).__name__}({', '.join(f'{n}={_short(getattr(self, n))}' for n in names)})"


def _short(value: Any) -> str:
    parts = value if isinstance(value, Sequence) else [value]
    parts = [*value, *value.values()] if isinstance(value, Mapping) else parts
    text = repr(value) if all(isinstance(part, PLAIN) for part in parts) else ""
    if 0 < len(text) <= WIDTH:
        return text
    shape = getattr(value, "shape", (len(value),) if isinstance(value, Sized) else ())
    size = " x ".join(map(str, shape))
    return f"<{type(value).__name__}{f' of {size}' if size else ''}>"
