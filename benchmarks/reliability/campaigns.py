"""Campaigns and replays that are interrupted, killed, or run an FMU that dies."""

import json
import random
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas

from .endings import (
    EXCEPTIONS,
    HANGING,
    HARMLESS,
    PATIENCE,
    ROOT,
    begin,
    environment,
    finish,
    mortal_fmu,
)
from .judgement import agreement_faults, line_faults
from .mortal import WAYS

LONGEST = 8.0  # wall time until the interrupt [s]; chosen: workers start, and runs end, within that
RUNS = 4000  # of a campaign; more than end before the interrupt


def campaign_file(work: Path, native: bool, stop: float = 3.0) -> Path:
    """The ellipse over seeds."""
    content = json.loads((ROOT / "scenarios" / "ellipse.json").read_text())
    (work / "some.json").write_text(
        json.dumps(content | {"stop": stop, "metrics": {}, "native": native})
    )
    axes = {"seed": {"set": "seed", "values": list(range(RUNS))}}
    path = work / "some.campaign.json"
    path.write_text(json.dumps({"scenario": "some.json", "axes": axes}))
    return path


def interrupted_campaigns(count: int, seed: int, work: Path, advance: Callable[[], None]) -> list[str]:
    """Interrupt campaigns in this process and in others, or kill what works, at random times."""
    rng, wrong = random.Random(seed), []
    for k in range(count):
        out, workers, native = work / f"campaign{k}", rng.choice((0, 2)), rng.random() < 0.7
        path, loop = campaign_file(work, native), rng.choice(({}, {"CYBERSHIP_LOOP": "plain"}))
        process = begin("cosim.campaign", path, "--workers", workers, "--out", out, **loop)
        time.sleep(rng.uniform(0.0, LONGEST))
        process.send_signal(rng.choice((signal.SIGINT, signal.SIGTERM)))
        asked = time.monotonic()
        stderr = finish(process)
        found = line_faults(process.returncode, stderr, {130}, time.monotonic() - asked)
        if (out / "campaign.json").is_file():
            found += agreement_faults(out, "interrupted")
        how = f"{workers} workers, native {native}, {loop or 'compiled'}"
        wrong += [f"campaign {k} ({how}): {text}" for text in found]
        shutil.rmtree(out, ignore_errors=True)
        advance()
    return wrong


def deaths_elsewhere(count: int, seed: int, work: Path, advance: Callable[[], None]) -> list[str]:
    """A mortal FMU in a campaign of one process, and as the controller of a replay."""
    rng, wrong = random.Random(seed), []
    ways = [w for w in WAYS if w not in (*HANGING, *HARMLESS, *EXCEPTIONS, "closed descriptors")]
    ways.remove("SIGTERM to parent")
    fmu = mortal_fmu(work)
    scenario = {"name": "mortal", "step": 0.01, "stop": 1.0, "fmus": {"bad": {"path": str(fmu)}}}
    (work / "mortal.json").write_text(json.dumps(scenario))
    axes = {"seed": {"set": "seed", "values": [0, 1]}}
    campaign = work / "mortal.campaign.json"
    campaign.write_text(json.dumps({"scenario": "mortal.json", "axes": axes}))
    t = np.arange(0.0, 12.0, 0.05)
    columns = {"x": np.sin(t), "y": t, "psi": 0.1 * np.sin(t), "tau_X": 0.1, "tau_Y": 0.1, "tau_N": 0.0}
    pandas.DataFrame({"time": t} | columns).to_csv(work / "run.csv", index=False)
    for k in range(count):
        way, out = rng.choice(ways), work / "dead"
        where = {"RELIABILITY_WAY": way, "RELIABILITY_WHERE": rng.choice(("enter", "leave", "step"))}
        if k % 2:
            process = begin("cosim.campaign", campaign, "--workers", 0, "--out", out, **where)
        else:
            process = begin(
                "thesis.replay", work / "run.csv", "--controller", fmu, "--out", out, **where
            )
        stderr = finish(process)
        found = line_faults(process.returncode, stderr, {3}, 0.0)
        if ("bad: " if k % 2 else "controller: ") not in stderr:
            found.append("the line does not name the FMU")
        if k % 2:
            found += agreement_faults(out, "failed")
        elif out.exists():
            found.append("a result of a replay that failed")
        wrong += [
            f"{way} in {where['RELIABILITY_WHERE']} ({'campaign' if k % 2 else 'replay'}): {text}"
            for text in found
        ]
        shutil.rmtree(out, ignore_errors=True)
        advance()
    return wrong


def spoilt_cache(count: int, seed: int, work: Path, advance: Callable[[], None]) -> list[str]:
    """Cut, change or empty a file of the cache: the next run makes it again, and says so."""
    rng, wrong, cache = random.Random(seed), [], work / "cache"
    path = work / "short.json"  # a path alone: more FMUs would be more files of the same kinds
    content = {"name": "short", "step": 0.01, "stop": 0.1, "native": True}
    path.write_text(json.dumps(content | {"fmus": {"guidance": {"path": "guidance_ellipse.fmu"}}}))

    def run() -> subprocess.CompletedProcess[str]:
        return subprocess.run(
            [sys.executable, "-m", "cosim.run", str(path), "--out", str(work / "kept"), "--no-plots"],
            capture_output=True, text=True, errors="replace", cwd=ROOT, check=False,
            env=environment(CYBERSHIP_CACHE=str(cache)), timeout=10 * PATIENCE,
        )  # fmt: skip

    if run().returncode != 0:
        return ["cache: the first run failed"]
    entries = sorted(p for p in cache.rglob("*") if p.suffix in (".so", ".fmu"))
    first = (work / "kept" / "log.csv").read_bytes()
    for k in range(count):
        victim = rng.choice(entries)
        content = bytearray(victim.read_bytes())
        if rng.random() < 0.5:
            del content[rng.randrange(len(content)) :]
        else:
            content[rng.randrange(len(content))] ^= 1 << rng.randrange(8)
        victim.write_bytes(content)
        done = run()
        found = line_faults(done.returncode, done.stderr, {0}, 0.0)
        if "was damaged" not in done.stderr:
            found.append("it does not say what was damaged")
        if (work / "kept" / "log.csv").read_bytes() != first:
            found.append("another log")
        wrong += [f"cache {k} ({victim.name}): {text}" for text in found]
        advance()
    return wrong
