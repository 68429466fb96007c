"""Numbers and units as the page and JSON show them."""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from fmus.effects.text import WRITTEN_OUT

NO_VALUE = "–"
_UNIT = str.maketrans({".": "·", "2": "²", "3": "³"})


def number(value: float | None, digits: int = 3, factor: float = 1.0) -> str:
    """A number to so many significant digits; a dash where it is None or not finite."""
    if value is None or not np.isfinite(value):
        return NO_VALUE
    scaled = factor * value
    text = f"{scaled:.{digits}g}"
    if "e" in text and 1.0 <= abs(scaled) < WRITTEN_OUT:
        text = f"{scaled:.0f}"
    return text.replace("-", "−")


def unit(text: str) -> str:
    """A unit of the FMUs for people: ``N.s2/m2`` as N·s²/m², nothing for ``1``."""
    return "" if text == "1" else text.translate(_UNIT)


def percent(value: float | None) -> str:
    """A share in per cent; a dash where it is None. One that is not zero is not written as zero."""
    if value is None or not np.isfinite(value):
        return NO_VALUE
    return "< 1 %" if 0.0 < 100.0 * value < 0.5 else f"{100.0 * value:.0f} %"


def times(before: float | None, after: float | None) -> str:
    """Ratio by which an error fell; a dash where there is none."""
    if before is None or after is None or not after or not np.isfinite(before / after):
        return NO_VALUE
    return f"{number(before / after, 2)}×"


def plain(value: object) -> str:
    """Any value that JSON can hold, on one line."""
    if isinstance(value, Mapping):
        return ", ".join(f"{key} {plain(each)}" for key, each in value.items())
    if isinstance(value, (list, tuple)):
        return ", ".join(plain(each) for each in value)
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, (int, float)):
        return number(value, 6)
    return NO_VALUE if value is None else str(value)


def finite(value: Any) -> Any:
    """What JSON can hold: arrays as lists, named tuples by name, numbers that are not finite as None."""
    if hasattr(value, "tolist"):
        value = value.tolist()
    elif hasattr(value, "_asdict"):
        value = value._asdict()
    if isinstance(value, Mapping):
        return {str(k): finite(v) for k, v in value.items()}
    if isinstance(value, (list, tuple)):
        return [finite(v) for v in value]
    return None if isinstance(value, float) and not np.isfinite(value) else value


def as_json(content: Any, indent: int | None = 2) -> str:
    """The text of a JSON file; a number that is not finite is null."""
    return json.dumps(finite(content), indent=indent, ensure_ascii=False, allow_nan=False)


def write_json(path: Path, content: Mapping[str, Any]) -> None:
    """Write a JSON file; a number that is not finite is null."""
    path.write_text(as_json(content) + "\n", encoding="utf-8")
