"""compare, learn, native builds and campaigns that are interrupted or killed: what they leave behind."""

import json
import random
import re
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from pathlib import Path

import cosim

from .campaigns import campaign_file
from .endings import PATIENCE, ROOT, begin, environment, finish
from .judgement import line_faults

# Wall time in which a command works, from its first handlers on [s]; chosen: on a machine that is not
# busy it ends within that.
COMPARES, LEARNS, BUILDS, CAMPAIGNS = 3.0, 10.0, 4.0, 8.0
PROGRESS = re.compile(r"\d+ s: .*\n")  # where there is no terminal, every half a minute
INTERRUPTS = (signal.SIGINT, signal.SIGTERM)


def interrupted_compares(count: int, seed: int, work: Path, advance: Callable[[], None]) -> list[str]:
    """Interrupt comparisons at random times: one line, and no more is left than was shown."""
    rng, wrong, runs, places = random.Random(seed), [], _runs(work), _temporary(work)
    for k in range(count):
        out, number = work / f"compare{k}" / "deep", rng.choice(INTERRUPTS)
        process = begin("diagnosis.compare", *runs, "--out", out, **places)
        time.sleep(rng.uniform(0.0, COMPARES))
        process.send_signal(number)
        asked = time.monotonic()
        stderr, late = finish(process), time.monotonic() - asked
        found = line_faults(process.returncode, PROGRESS.sub("", stderr), {0, 130}, late)
        if process.returncode == 130:
            left, answer = {*_files(out.parent)}, out / "comparison.json"
            if answer.exists():  # the first answer stays, whole
                json.loads(answer.read_text())
                left -= {out.name, f"{out.name}/{answer.name}"}
            found += [f"it leaves {name}" for name in sorted(left)]
        found += [f"it leaves {name}" for name in _files(Path(places["TMPDIR"]))]
        wrong += [f"compare {k} ({number.name}): {text}" for text in found]
        shutil.rmtree(out.parent, ignore_errors=True)
        advance()
    return wrong


def killed_diagnoses(count: int, seed: int, work: Path, advance: Callable[[], None]) -> list[str]:
    """Kill compare and learn (SIGKILL): the next call removes what they have left, and says so."""
    rng, wrong, runs, places = random.Random(seed), [], _runs(work), _temporary(work)
    for k in range(count):
        name, longest = (("compare", COMPARES), ("learn", LEARNS))[k % 2]
        out = work / f"killed{k}"
        process = begin(f"diagnosis.{name}", *runs, "--out", out, **places)
        time.sleep(rng.uniform(0.0, longest))
        process.kill()
        finish(process)
        time.sleep(0.2)  # the working process is killed with it
        left = [p for p in _files(out) if ".new-" in p]
        done = _call(f"diagnosis.{name}", work / "nowhere.csv", "--out", out, **places)
        found = [f"it leaves {p}" for p in _files(out) if ".new-" in p]
        found += [f"it leaves {p}" for p in _files(Path(places["TMPDIR"]))]
        if bool(left) != ("note: removed 1 unfinished result" in done.stderr):
            found.append(f"of {len(left)} files that were removed it says {done.stderr!r}")
        wrong += [f"{name} {k}: {text}" for text in found]
        shutil.rmtree(out, ignore_errors=True)
        advance()
    return wrong


def ended_builds(count: int, seed: int, work: Path, advance: Callable[[], None]) -> list[str]:
    """Interrupt or kill native builds: nothing is left in the folder for temporary files."""
    rng, wrong, places = random.Random(seed), [], _temporary(work)
    for k in range(count):
        cache, number = work / f"cache{k}", rng.choice((*INTERRUPTS, signal.SIGKILL))
        places["CYBERSHIP_CACHE"] = str(cache)
        out = work / f"built{k}"
        process = begin("fmus.build", "--native", "--ship", "otter", "vessel", "--out", out, **places)
        time.sleep(rng.uniform(0.0, BUILDS))
        process.send_signal(number)
        stderr = finish(process)
        killed = number == signal.SIGKILL
        found = [] if killed else line_faults(process.returncode, stderr, {0, 130}, 0.0)
        done = _call("fmus.build", "--list", **places)
        found += line_faults(done.returncode, done.stderr, {0}, 0.0)
        found += [f"it leaves {name}" for name in _files(Path(places["TMPDIR"]))]
        wrong += [f"build {k} ({number.name}): {text}" for text in found]
        for folder in (cache, out):
            shutil.rmtree(folder, ignore_errors=True)
        advance()
    return wrong


def killed_campaigns(count: int, seed: int, work: Path, advance: Callable[[], None]) -> list[str]:
    """Kill campaigns in this process and in others: the next one removes what they have left."""
    rng, wrong, places = random.Random(seed), [], _temporary(work)
    path = campaign_file(work, native=False)
    few = work / "few.campaign.json"
    axes = {"seed": {"set": "seed", "values": [0]}}
    few.write_text(json.dumps({"scenario": path.with_name("some.json").name, "axes": axes}))
    for k in range(count):
        out, workers = work / f"campaign{k}", rng.choice((0, 2))
        process = begin("cosim.campaign", path, "--workers", workers, "--out", out, **places)
        time.sleep(rng.uniform(0.0, CAMPAIGNS))
        process.kill()
        finish(process)
        time.sleep(2.0)  # its workers end when they see it
        done = _call(
            "cosim.campaign", few, "--workers", 0, "--out", work / "next", "--overwrite", **places
        )
        found = line_faults(done.returncode, done.stderr, {0}, 0.0)
        found += [f"it leaves {name}" for name in _files(Path(places["TMPDIR"]))]
        wrong += [f"campaign {k} ({workers} workers): {text}" for text in found]
        shutil.rmtree(out, ignore_errors=True)
        advance()
    return wrong


def _runs(work: Path) -> list[Path]:
    """Logs of two runs of the ellipse."""
    content = json.loads((ROOT / "scenarios" / "ellipse.json").read_text())
    folders = [work / "one", work / "two"]
    for k, folder in enumerate(folders):
        cosim.simulate(cosim.load_scenario(content | {"stop": 40.0 + 8.0 * k, "metrics": {}}), folder)
    return folders


def _temporary(work: Path) -> dict[str, str]:
    """Variables that give a command a folder of its own for temporary files."""
    folder = work / "temporary"
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir()
    return {"TMPDIR": str(folder)}


def _files(folder: Path) -> Sequence[str]:
    """What lies in a folder, folders included."""
    return sorted(str(path.relative_to(folder)) for path in folder.rglob("*"))


def _call(command: str, *arguments: object, **variables: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-m", command, *map(str, arguments)],
        capture_output=True, text=True, errors="replace", cwd=ROOT, env=environment(**variables),
        check=False, timeout=PATIENCE,
    )  # fmt: skip
