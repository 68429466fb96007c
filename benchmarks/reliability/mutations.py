"""Broken scenarios, parameter sets, archives and measurements, read in this process."""

import contextlib
import copy
import json
import random
import shutil
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np

import cosim
from cosim.command import printable
from cosim.system import prepare
from fmus.build import build

from .judgement import faults

ROOT = Path(__file__).parent.parent.parent
SHIPPED = sorted((ROOT / "scenarios").glob("*.json"))
VALUES = (
    None, True, "", "0.01", "\x1b[31mred", "x" * 5000, -1, 0, 1, 7, 0.5, 1e-9, -1e300, 10**400,
    float("nan"), float("inf"), [], {}, [[]], {"a": 1}, "../../etc/passwd", "vessel.fmu", "*", "\u202e",
)  # fmt: skip
STOP = 0.05  # s; enough for the first steps
STEPS = 20_000  # a mutation that asks for more steps is not run


def places(content: Any) -> Iterator[tuple[Any, Any]]:
    """Every key of every object and every index of every list: (container, key)."""
    keys = (
        content
        if isinstance(content, dict)
        else range(len(content))
        if isinstance(content, list)
        else ()
    )
    for key in list(keys):
        yield content, key
        yield from places(content[key])


def mutate(content: dict[str, Any], rng: random.Random) -> None:
    """Break a scenario in one to three places."""
    for _ in range(rng.randint(1, 3)):
        found = list(places(content))
        if not found:
            return
        container, key = rng.choice(found)
        kind = rng.randrange(4)
        if kind == 0:
            container[key] = copy.deepcopy(rng.choice(VALUES))
        elif kind == 1:
            del container[key]
        elif kind == 2 and isinstance(container, dict):
            container[str(key) + rng.choice(("x", " ", "\x07", "\n"))] = container.pop(key)
        else:
            other, there = rng.choice(found)
            container[key] = copy.deepcopy(other[there])


def broken_scenarios(count: int, seed: int, work: Path, advance: Callable[[], None]) -> list[str]:
    """Run mutations of the shipped scenarios; returns what misbehaved."""
    files = {path.name: str(path) for path in build([])}
    rng, wrong = random.Random(seed), []
    for k in range(count):
        shipped = rng.choice(SHIPPED)
        content = json.loads(shipped.read_text())
        content |= {"stop": STOP, "metrics": {}}
        mutate(content, rng)
        with contextlib.suppress(TypeError, ValueError, ZeroDivisionError, OverflowError):
            if float(content.get("stop", 0)) / float(content.get("step", 1)) > STEPS:
                content["stop"] = STOP
        path, out = work / "broken.json", work / f"out{k}"
        path.write_text(json.dumps(located(content, files)), encoding="utf-8", errors="surrogatepass")
        wrong += [f"scenario {k} of {shipped.name}: {text}" for text in _run(path, out)]
        shutil.rmtree(out, ignore_errors=True)
        advance()
    return wrong


def _run(path: Path, out: Path) -> list[str]:
    """Run a scenario as ``python -m cosim.run`` does; returns what misbehaved."""
    lines: list[str] = []
    try:
        result = cosim.simulate(cosim.load_scenario(path), out, show=lines.append)
        code = {"done": 0, "failed": 3}[result.status]
        lines += [f"error: {result.message}"] if code else []
    except cosim.InputError as error:
        code = 2
        lines.append(f"error: {error}")
    except BaseException as error:
        return [f"{error!r}"]
    return faults(code, "\n".join(map(printable, lines)), out, {0, 2, 3})


def located(content: Any, files: dict[str, str]) -> Any:
    """The same content with the paths of our FMUs: the builder's process would take most of the time."""
    if isinstance(content, dict):
        return {key: located(value, files) for key, value in content.items()}
    if isinstance(content, list):
        return [located(value, files) for value in content]
    return files.get(content, content) if isinstance(content, str) else content


SSV = """<?xml version="1.0" encoding="UTF-8"?>
<ssv:ParameterSet xmlns:ssv="http://ssp-standard.org/SSP1/SystemStructureParameterValues"
                  version="1.0" name="learned"><ssv:Parameters>
<ssv:Parameter name="vessel.delta_X_u"><ssv:Real value="-4.0" unit="N.s/m"/></ssv:Parameter>
</ssv:Parameters></ssv:ParameterSet>
"""


def measurement() -> str:
    """A made-up measured run of 40 s."""
    t = np.arange(0.0, 40.0, 0.05)
    columns = [t, np.sin(0.1 * t), np.cos(0.1 * t), 0.1 * t, 0.5 + 0 * t, 0.1 * np.sin(t), 0.0 * t]
    rows = "\n".join(",".join(f"{x:.6g}" for x in row) for row in zip(*columns, strict=True))
    return f"time,x,y,psi,tau_X,tau_Y,tau_N\n{rows}\n"


def broken_files(count: int, seed: int, work: Path, advance: Callable[[], None]) -> list[str]:
    """Read damaged parameter sets, archives and measurements; returns what misbehaved."""
    import diagnosis

    (fmu,) = build(["guidance_ellipse"])
    kinds: list[tuple[str, bytes, Callable[[Path], object]]] = [
        ("a.ssv", SSV.encode(), cosim.read_parameters),
        ("a.fmu", fmu.read_bytes(), _prepare),
        ("a.csv", measurement().encode(), lambda path: diagnosis.clean(diagnosis.read(path))),
    ]
    rng, wrong = random.Random(seed), []
    for k in range(count):
        name, data, read = kinds[k % len(kinds)]
        path = work / name
        path.write_bytes(damage(data, rng))
        try:
            read(path)
        except cosim.InputError:
            pass
        except BaseException as error:
            wrong.append(f"file {k} ({name}): {error!r}")
        advance()
    return wrong


def damage(data: bytes, rng: random.Random) -> bytes:
    """Bytes with some changed, taken out, doubled, or cut off."""
    changed = bytearray(data)
    for _ in range(rng.randint(1, 8)):
        at = rng.randrange(len(changed) + 1)
        kind = rng.randrange(4)
        if kind == 0 and at < len(changed):
            changed[at] = rng.randrange(256)
        elif kind == 1:
            del changed[at : at + rng.randint(1, 50)]
        elif kind == 2:
            changed[at:at] = changed[at : at + rng.randint(1, 50)]
        elif rng.random() < 0.2:
            del changed[at:]
    return bytes(changed)


def _prepare(path: Path) -> None:
    content = {"name": "a", "step": 0.01, "stop": 0.1, "fmus": {"a": {"path": str(path)}}}
    prepare(cosim.load_scenario(content)).close()
