"""Mutated files of ships, read in this process, and some of them built: refused in a line, or a ship."""

import os
import random
import re
import resource
import time
from collections.abc import Callable
from contextlib import contextmanager
from pathlib import Path

from fmus.build import BuildError, build
from fmus.declare import DeclarationError
from fmus.effects.text import Found
from fmus.ship import ship
from fmus.ships.ship_file import read_ship

from .mutations import damage

ROOT = Path(__file__).parent.parent.parent
SHIPPED = sorted((ROOT / "ships").glob("*.toml"))
NUMBER = re.compile(r"(?<![\w.\"])-?\d+(?:\.\d+)?(?:e-?\d+)?(?![\w.\"])")
TEXT = re.compile(r'"[^"\n]*"')
NUMBERS = (
    *("0.0", "-1.0", "1", "0.0101", "0.2", "100.0", "999.9", "1e6", "1e9", "1e15", "1e30", "1e300"),
    *("-1e300", "1e-9", "1e-300", "5e-324", "inf", "nan", "true", "[]", "{}", '"1"', "1979-05-27"),
    *("9" * 400, "9" * 5000),
)
TEXTS = (
    '""', '"{0}{title}"', '"{"', '"%s %(a)d"', '"\\u001b[31mred\\n"', '"\\u202e"', "1", '"for"', '"é"',
    '"surge"', '"../x"', '"\'\'\'"', '"\\\\"', f'"{"x" * 5000}"', f'"{"x y " * 25000}"',
)  # fmt: skip
EACH = 20  # of so many ships that are read one is built; chosen: building takes a second
# Processor time in which a file has to be read, and its ship made and built [s]; chosen: a few times
# what shipped ones take.
LONGEST = 10.0
LONGEST_LINE = 1000  # characters of a message, but for the name of the file


def broken_ships(count: int, seed: int, work: Path, advance: Callable[[], None]) -> list[str]:
    """Read mutations of the shipped files, and build some; returns what misbehaved."""
    rng, wrong, path = random.Random(seed), [], work / "broken.toml"
    with _cache(work / "ships"):
        for k in range(count):
            shipped = rng.choice(SHIPPED)
            path.write_bytes(mutated(shipped.read_text(encoding="utf-8"), rng))
            began = _processor_time()
            found = _faults(path, k % EACH == 0)
            if (took := _processor_time() - began) > LONGEST:
                found.append(f"it took {took:.0f} s of processor time")
            wrong += [f"ship {k} of {shipped.name}: {text}" for text in found]
            advance()
    return wrong


def mutated(text: str, rng: random.Random) -> bytes:
    """A file broken in one to three places."""
    for _ in range(rng.randint(1, 3)):
        kind = rng.randrange(8)
        if kind < 4:
            text = _replaced(text, NUMBER, NUMBERS, rng)
        elif kind < 6:
            text = _replaced(text, TEXT, TEXTS, rng)
        else:
            lines = text.splitlines(keepends=True)
            at = rng.randrange(len(lines))
            if kind == 6:
                lines[at : at + 1] = lines[at : at + 1] * rng.choice((0, 2))
            else:
                lines[at] = lines[at].replace(" =", rng.choice(("x =", ".y =", " .z =")), 1)
            text = "".join(lines)
    data = text.encode()
    return damage(data, rng) if rng.random() < 0.1 else data


def _replaced(text: str, what: re.Pattern[str], by: tuple[str, ...], rng: random.Random) -> str:
    found = [place for place in what.finditer(text) if "\n#" not in text[: place.start()][-200:]]
    if not found:
        return text
    place = rng.choice(found)
    return text[: place.start()] + rng.choice(by) + text[place.end() :]


def _faults(path: Path, built: bool) -> list[str]:
    """What is wrong with how a file is refused, or with the ship that it describes."""
    try:
        made = ship(description=read_ship(path))
        for effect in made.effects.values():
            if effect.wording is not None:
                effect.wording.sentence(Found(effect, {p.name: 0.5 for p in effect.parameters}))
        if built:
            build(["vessel", "thrusters"], path.parent, overwrite=True, ship=made.description)
    except (DeclarationError, BuildError) as error:
        line = str(error).replace(str(path), "")
        wrong = [] if line.isprintable() else ["control characters in the message"]
        return wrong + ([f"a message of {len(line)} characters"] if len(line) > LONGEST_LINE else [])
    except BaseException as error:
        return [f"{error!r}"]
    return []


def _processor_time() -> float:
    """Of this process and those that it has waited for [s]."""
    return time.process_time() + resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime


@contextmanager
def _cache(folder: Path):
    """FMUs are kept in a folder that goes with the others."""
    before = os.environ.get("CYBERSHIP_CACHE")
    os.environ["CYBERSHIP_CACHE"] = str(folder)
    try:
        yield
    finally:
        if before is None:
            del os.environ["CYBERSHIP_CACHE"]
        else:
            os.environ["CYBERSHIP_CACHE"] = before
