"""Numbers, units and verdicts as the page writes them."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

VERDICTS = {
    "found": "Something is missing, and it was found",
    "ambiguous": "Something is missing, and more than one cause fits",
    "none": "Nothing is missing that these data show",
}
NOTHING = "–"
_UNIT = str.maketrans({".": "·", "2": "²", "3": "³"})


def number(value: Any, digits: int = 3, factor: float = 1.0) -> str:
    """A number for people; a dash where there is none."""
    if value is None or isinstance(value, bool) or not np.isfinite(float(value)):
        return NOTHING
    scaled = factor * float(value)
    text = f"{scaled:.{digits}g}"
    if "e" in text and 1e-4 <= abs(scaled) < 1e6:
        text = f"{scaled:.0f}" if abs(scaled) >= 1.0 else f"{scaled:.6f}".rstrip("0")
    return text.replace("-", "−")


def unit(text: Any) -> str:
    """``N.s2/m2`` as N·s²/m²."""
    return "" if text in (None, "1", "") else str(text).translate(_UNIT)


def percent(value: Any) -> str:
    return NOTHING if value is None else f"{100.0 * float(value):.0f} %"


def times(before: Any, after: Any) -> str:
    """By how much an error fell."""
    if before is None or after is None or not after or not np.isfinite(before / after):
        return NOTHING
    ratio = before / after
    return f"{ratio:.0f}×" if ratio >= 9.95 else f"{ratio:.1f}×"


def plain(value: Any) -> str:
    """Anything that JSON can hold, on one line."""
    if isinstance(value, Mapping):
        return ", ".join(f"{key} {plain(each)}" for key, each in value.items())
    if isinstance(value, str):
        return value
    if isinstance(value, Sequence):
        return ", ".join(plain(each) for each in value)
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, (int, float)):
        return number(value, 6)
    return NOTHING if value is None else str(value)


def sentences(found: Any) -> list[str]:
    """What is said of the regions where a model fails: sentences, or mappings that have one."""
    if isinstance(found, Mapping):
        found = found.get("sentences") or [f"{key}: {plain(each)}" for key, each in found.items()]
    items = [found] if isinstance(found, str) else list(found or [])
    return [i.get("sentence") or plain(i) if isinstance(i, Mapping) else str(i) for i in items]
