"""Compares two answers of a case, key by key, and names what a user would notice first."""

import json
import math
from collections.abc import Collection, Iterator, Mapping
from pathlib import Path
from typing import Any, NamedTuple

ABSOLUTE = 1e-12  # below which numbers are the same, whatever they are relative to
SURE = 0.01  # change of a confidence that is reported apart
FIRST = 6  # keys of a case that are printed


class Differences(NamedTuple):
    """What differs between two answers of a case.

    Attributes:
        values: key -> value before and after.
        before, after: keys that only one of them has.
        notable: changes of verdict, effects, confidence and held-out errors, a line each.
    """

    values: dict[str, tuple[Any, Any]]
    before: list[str]
    after: list[str]
    notable: list[str]

    def __bool__(self) -> bool:
        return bool(self.values or self.before or self.after)


def differences(
    before: Mapping[str, Any],
    after: Mapping[str, Any],
    tolerance: float = 1e-9,
    ignored: Collection[str] = (),
) -> Differences:
    """Compare two answers.

    Args:
        before, after: of :func:`.case_answers.answer`.
        tolerance: relative one of numbers; they are the same also within 1e-12.
        ignored: keys that are left out, at any depth.
    """
    a, b = dict(leaves(before, ignored)), dict(leaves(after, ignored))
    return Differences(
        {key: (a[key], b[key]) for key in a if key in b and not same(a[key], b[key], tolerance)},
        [key for key in a if key not in b],
        [key for key in b if key not in a],
        notable(before, after, tolerance),
    )


def leaves(content: Any, ignored: Collection[str], path: str = "") -> Iterator[tuple[str, Any]]:
    """Each value of a JSON content with the keys and numbers that lead to it; empty lists are values."""
    if isinstance(content, dict) and content:
        for key, value in content.items():
            if key not in ignored:
                yield from leaves(value, ignored, f"{path}.{key}" if path else key)
    elif isinstance(content, list) and content:
        for k, value in enumerate(content):
            yield from leaves(value, ignored, f"{path}[{k}]")
    else:
        yield path, content


def same(a: Any, b: Any, tolerance: float) -> bool:
    """Whether two values are equal; numbers within the tolerance."""
    if is_number(a) and is_number(b):
        return math.isclose(a, b, rel_tol=tolerance, abs_tol=ABSOLUTE)
    return type(a) is type(b) and a == b


def is_number(value: Any) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool)


def notable(before: Mapping[str, Any], after: Mapping[str, Any], tolerance: float) -> list[str]:
    """Changes of exit code, verdict, effects, confidence and held-out errors, a line each."""
    a, b = headline(before), headline(after)
    found = []
    for key in dict.fromkeys([*a, *b]):
        old, new = a.get(key), b.get(key)
        if key.startswith("confidence") and isinstance(old, float) and isinstance(new, float):
            changed = abs(new - old) > SURE
        else:
            changed = not same(old, new, tolerance)
        if changed:
            found.append(f"{key}: {short(old)} -> {short(new)}")
    return found


def headline(answer: Mapping[str, Any]) -> dict[str, Any]:
    """What a user reads first: exit code, verdict, effects, confidences and held-out errors."""
    content = answer.get("diagnosis") or answer.get("comparison") or {}
    found: dict[str, Any] = {"exit": answer.get("exit"), "verdict": content.get("verdict")}
    for group in ("effects", "possibilities"):
        stated = content.get(group) or []
        found[group] = " ".join(e["id"] for e in stated)
        found |= {f"confidence of {e['id']}": e.get("confidence") for e in stated}
    for error in content.get("errors") or []:
        if error.get("held_out") or error.get("use") == "test":
            key = f"held-out position error of {error['run']}"
            found[key] = (error.get("window_position_rmse") or {}).get("after")
    return found


def short(value: Any) -> str:
    """A value in a few characters."""
    text = f"{value:.12g}" if isinstance(value, float) else str(value)
    return text if len(text) <= 70 else f"{text[:67]}..."


def compare(before: Path, after: Path, tolerance: float, ignored: Collection[str]) -> int:
    """Print how the answers in two folders differ; returns 1 if any does.

    Args:
        before, after: folders of answers.
        tolerance: relative one of numbers.
        ignored: keys that are left out.
    """
    files = {p.stem: p for p in before.glob("*.json")}, {p.stem: p for p in after.glob("*.json")}
    missing = sorted(files[0].keys() ^ files[1].keys())
    agree, differ, lines = 0, 0, []
    for name in sorted(files[0].keys() & files[1].keys()):
        a, b = (json.loads(f[name].read_text(encoding="utf-8")) for f in files)
        found = differences(a, b, tolerance, ignored)
        if not found:
            agree += 1
            continue
        differ += 1
        lines += [f"  {name}: {line}" for line in found.notable]
        print(f"{name}: {len(found.values)} values differ")
        for key, (old, new) in list(found.values.items())[:FIRST]:
            print(f"  {key}: {short(old)} -> {short(new)}")
        for side, keys in (("before", found.before), ("after", found.after)):
            if keys:
                more = "" if len(keys) <= FIRST else ", ..."
                print(f"  only {side}, {len(keys)} keys: {', '.join(keys[:FIRST])}{more}")
    if lines:
        print("Verdicts, effects, confidences and held-out errors that changed:", *lines, sep="\n")
    if missing:
        print(f"only in one of the folders: {', '.join(missing)}")
    print(f"{agree} cases the same, {differ} differ")
    return int(bool(differ or missing or not agree))
