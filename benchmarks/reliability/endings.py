"""Commands that are killed, interrupted, short of disk, or run an FMU that dies."""

import json
import os
import random
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

from .judgement import faults, log_faults
from .mortal import WAYS

ROOT = Path(__file__).parent.parent.parent
WHERE = ("instantiate", "setup", "enter", "leave", "set", "get", "step", "terminate")
HANGING = ("hang", "hang in C", "spin")
EXCEPTIONS = ("exception", "stack", "memory")
HARMLESS = ("fork", "fork, child ends", "flood", "SIGUSR1 to parent")
# Longest wall time of one command [s]; chosen: none takes as long on a busy machine.
PATIENCE = 60.0


def environment(**variables: str) -> dict[str, str]:
    """The environment of a command."""
    return {**os.environ, **variables}


def begin(command: str, *arguments: object, **variables: str) -> subprocess.Popen[str]:
    """A command in the background, once its handlers are there."""
    process = subprocess.Popen(
        [sys.executable, "-m", command, *map(str, arguments)],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
        errors="replace",
        cwd=ROOT,
        env=environment(**variables),
    )
    until = time.monotonic() + PATIENCE
    while time.monotonic() < until and process.poll() is None and not catches(process.pid):
        time.sleep(0.001)
    return process


def start(path: Path, out: Path, **variables: str) -> subprocess.Popen[str]:
    """A run in the background, once its handlers are there."""
    return begin("cosim.run", path, "--out", out, "--no-plots", **variables)


def catches(pid: int) -> bool:
    """Whether a process has a handler for SIGTERM (Linux)."""
    try:
        status = Path(f"/proc/{pid}/status").read_text()
    except OSError:
        return False
    caught = next((line for line in status.splitlines() if line.startswith("SigCgt")), "SigCgt: 0")
    return bool(int(caught.split()[1], 16) >> (signal.SIGTERM - 1) & 1)


def simulating(pid: int) -> int | None:
    """The process that simulates for a command."""
    listed = subprocess.run(
        ["ps", "-o", "pid=", "--ppid", str(pid)], capture_output=True, text=True, check=False
    )
    return int(listed.stdout.split()[0]) if listed.stdout.split() else None


def finish(process: subprocess.Popen[str]) -> str:
    """Wait for its end; returns its standard error."""
    try:
        return process.communicate(timeout=PATIENCE)[1]
    except subprocess.TimeoutExpired:
        process.kill()
        return process.communicate()[1] + "\nerror: it did not end"


def long_scenario(work: Path, native: bool = False) -> Path:
    """The ellipse, without an end in sight."""
    content = json.loads((ROOT / "scenarios" / "ellipse.json").read_text())
    path = work / f"long_{native}.json"
    # Native FMUs are many times as fast.
    stop = 1_000_000.0 if native else 100_000.0
    path.write_text(json.dumps(content | {"stop": stop, "metrics": {}, "native": native}))
    return path


def kind(work: Path, rng: random.Random) -> tuple[Path, dict[str, str]]:
    """A long run of native or Python FMUs, and the environment of one of the two loops."""
    path = long_scenario(work, rng.random() < 0.5)
    return path, rng.choice(({}, {"CYBERSHIP_LOOP": "plain"}))


def kills(count: int, seed: int, work: Path, advance: Callable[[], None]) -> list[str]:
    """Kill the simulating process, and every second time the supervising one, at random times."""
    rng, wrong = random.Random(seed), []
    for k in range(count):
        out, (path, loop) = work / f"kill{k}", kind(work, rng)
        process = start(path, out, **loop)
        time.sleep(rng.uniform(0.0, 2.0))
        if k % 2:
            process.kill()
            finish(process)
            time.sleep(0.2)
            found = log_faults(out, "running") if (out / "log.json").is_file() else []
        else:
            victim = simulating(process.pid)
            if victim is not None:
                os.kill(victim, signal.SIGKILL)
            stderr = finish(process)
            code = process.returncode
            found = [f for f in faults(code, stderr, out, {3}) if f != "no log.json"]
        wrong += [f"kill {k}: {text}" for text in found]
        shutil.rmtree(out, ignore_errors=True)
        advance()
    return wrong


def signals(count: int, seed: int, work: Path, advance: Callable[[], None]) -> list[str]:
    """Interrupt a run at random times, imports and instantiation included."""
    rng, wrong = random.Random(seed), []
    for k in range(count):
        out, number = work / f"signal{k}", rng.choice((signal.SIGINT, signal.SIGTERM))
        path, loop = kind(work, rng)
        process = start(path, out, **loop)
        time.sleep(rng.uniform(0.0, 1.5))
        process.send_signal(number)
        asked = time.monotonic()
        stderr = finish(process)
        late = time.monotonic() - asked
        found = faults(process.returncode, stderr, out, {130}, late=late)
        wrong += [f"signal {k} ({number.name}): {text}" for text in found]
        shutil.rmtree(out, ignore_errors=True)
        advance()
    return wrong


def short_of_disk(count: int, seed: int, work: Path, advance: Callable[[], None]) -> list[str]:
    """Limit the size of files, which cuts a write short and fails the next."""
    import resource

    rng, wrong, path = random.Random(seed), [], long_scenario(work)
    for k in range(count):
        out, size = work / f"short{k}", rng.randint(600_000, 2_000_000)  # an unpacked FMU has room
        done = subprocess.run(
            [sys.executable, "-m", "cosim.run", str(path), "--out", str(out), "--no-plots", "--quiet"],
            capture_output=True,
            text=True,
            cwd=ROOT,
            check=False,
            preexec_fn=lambda size=size: resource.setrlimit(resource.RLIMIT_FSIZE, (size, size)),
        )
        found = faults(done.returncode, done.stderr, out, {3})
        wrong += [f"disk {k} ({size} bytes): {text}" for text in found]
        shutil.rmtree(out, ignore_errors=True)
        advance()
    return wrong


def mortal_fmu(work: Path) -> Path:
    """The FMU that dies as the environment says."""
    from pythonfmu.builder import FmuBuilder

    return Path(FmuBuilder.build_FMU(Path(__file__).with_name("mortal.py"), dest=work))


def deaths(chosen: int | None, seed: int, work: Path, advance: Callable[[], None]) -> list[str]:
    """Run the mortal FMU beside one of ours, for each way to die in each function."""
    fmu = mortal_fmu(work)
    content = {
        "name": "mortal", "step": 0.01, "stop": 1.0, "algorithm": "jacobi",
        "fmus": {"guidance": {"path": "guidance_ellipse.fmu"}, "bad": {"path": str(fmu)}},
        "connections": [["guidance.x_t", "bad.u"]],
    }  # fmt: skip
    path, wrong = work / "mortal.json", []
    path.write_text(json.dumps(content))
    for way, where in cases(chosen, seed):
        out = work / "mortal"
        process = start(path, out, RELIABILITY_WAY=way, RELIABILITY_WHERE=where)
        if way in HANGING:
            time.sleep(1.5)
            for _ in range(2):
                process.send_signal(signal.SIGINT)
                time.sleep(0.3)
        stderr = finish(process)
        expected = endings(way, where)
        named = "" if way == "closed descriptors" else "bad"
        found = faults(process.returncode, stderr, out, expected, named)
        wrong += [f"{way} in {where}: {text}" for text in found]
        shutil.rmtree(out, ignore_errors=True)
        advance()
    return wrong


def endings(way: str, where: str) -> set[int]:
    """Exit codes that are right for a death."""
    if way in HARMLESS:
        return {0}
    if way == "SIGTERM to parent":
        # A request like any; in the last call of all the run may be done before it acts.
        return {0, 130} if where == "terminate" else {130}
    if way in HANGING:
        return {130}
    if where == "instantiate" and way in EXCEPTIONS:
        return {2}  # whether an FMU can be instantiated is a matter of input
    if where == "terminate" and way in ("exception", "stack"):
        return {0}  # the run is done, and goes on from an exception
    if (where == "terminate" and way in ("memory", "closed descriptors")) or (
        where in WHERE[:4] and way == "closed descriptors"
    ):
        return {0, 3}  # what was taken away may or may not be needed any more, or yet
    return {3}


def cases(chosen: int | None, seed: int) -> list[tuple[str, str]]:
    """(way, function) of each death; all, or so many."""
    every = [(way, where) for way in WAYS for where in WHERE] + [("wrong status", "step")]
    return every if chosen is None else random.Random(seed).sample(every, min(chosen, len(every)))
