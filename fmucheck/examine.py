"""All rules on one FMU: those that read it here, those that run it each in a process of its own."""

import threading
from collections.abc import Callable, Sequence

from . import rules  # noqa: F401  # registers them
from .fmu import FmuArchive, platform
from .registry import RULES, NotApplicableError, NotInstalledError, Outcome, Rule
from .trial import StoppedError, attempt


def examine(
    fmu: FmuArchive,
    chosen: Sequence[Rule],
    timeout: float = 60.0,
    run: bool = True,
    done: Callable[[], None] = lambda: None,
    stopped: threading.Event | None = None,
) -> dict[str, Outcome]:
    """Check one FMU.

    Args:
        fmu: the FMU.
        chosen: rules to check.
        timeout: for each trial [s].
        run: whether to run the FMU at all.
        done: called after each rule.
        stopped: set from outside to end at once.

    Returns:
        Name of the rule -> what it found.

    Raises:
        StoppedError: it was ended.
    """
    stopped = stopped or threading.Event()
    obstacle = _obstacle(fmu) if run else "running the FMU was not requested"
    outcomes: dict[str, Outcome] = {}
    for rule in chosen:
        if stopped.is_set():
            raise StoppedError
        if not rule.runs:
            outcomes[rule.name] = _read(rule, fmu)
        elif obstacle:
            outcomes[rule.name] = Outcome(skipped=obstacle)
        else:
            outcomes[rule.name] = attempt(rule, fmu, timeout, stopped)
        done()
    return outcomes


def _obstacle(fmu: FmuArchive) -> str:
    """Why the FMU cannot be run, or nothing."""
    if fmu.library not in {member.filename for member in fmu.members}:
        return f"there is no binary for {platform()}"
    if any(RULES["archive"].check(fmu)):
        return "its archive is refused"
    if not all(v.type and v.reference is not None for v in fmu.description.variables):
        return "variables have no type or no value reference"
    return ""


def _read(rule: Rule, fmu: FmuArchive) -> Outcome:
    outcome = Outcome()
    try:
        outcome.found += rule.check(fmu)
    except NotInstalledError as tool:
        outcome.skipped, outcome.missing = f"{tool} is not installed", True
    except NotApplicableError as reason:
        outcome.skipped = str(reason)
    except Exception as error:
        outcome.found.append(f"internal error of the check: {error!r}; please report it")
    return outcome
