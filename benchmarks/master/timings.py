"""The tables."""

import statistics
from collections.abc import Callable, Sequence
from typing import Any

from .cases import CASES, TOOLS

DIFFERENCES = """
This master steps one FMU after the other, with noise and freezes on the measurements. The others
cannot freeze a measurement: they run without faults and so do less. They exchange values once a
step (Jacobi), as the last line does; 'end away' is how far the outputs in their last row are from
that line's, relative to max(1, |value|). This master writes numbers that read back to the bit,
libcosim 6 significant digits in a file for each FMU, Ecos 6 decimals. FMPy moves values one at a time,
passes nothing before the first step, and writes its log at the end; the container, too, is logged by
FMPy. Set-up counts from the import of the tool to the first step."""


def _per_step(found: dict[str, Any], pick: Callable[[Sequence[float]], float]) -> float:
    """Microseconds per step, over the repeats."""
    return 1e6 * pick([run["per_step"] for run in found["runs"]])


def report(results: dict[str, Any]) -> None:
    """Print the tables."""
    print(", ".join(f"{name} {value}" for name, value in results["machine"].items()))
    kind = "native" if results["native"] else "Python"
    size = f"{results['fmus']} {kind} FMUs, {results['connections']} connections"
    times = f"each of {results['steps']} steps, {results['repeat']} interleaved repeats"
    print(f"{size}, {results['signals']} signals logged at {times}\n")
    _report_tools(results["cases"])
    if not results["native"]:
        _report_parts(results["cases"])
    print("\nWhole command, from the start of the process to its end [s]   median     min")
    for label, times in results["commands"].items():
        print(f"  {label:58} {statistics.median(times):7.2f} {min(times):7.2f}")
    for label, times in results["commands"].items():
        if (plain := label.replace("with", "no")) != label:
            ratio = min(times) / min(results["commands"][plain]) - 1.0
            print(f"  {label}: the pictures take {ratio:.2f} times as long as all else")


def _report_tools(cases: dict[str, Any]) -> None:
    print("                                 us per step      ratio   set-up     log    end")
    print("                               median     min               [s]    [MB]   away")
    ours = None if "error" in cases["master"] else _per_step(cases["master"], statistics.median)
    shown = [*TOOLS, "master_like_others", "no_log", "neither"]
    for case in [name for name in shown if name in cases]:
        found = cases[case]
        if "error" in found:
            print(f"{CASES[case].label:30} {found['error']}")
            continue
        median = _per_step(found, statistics.median)
        setup = statistics.median(run["setup"] for run in found["runs"])
        ratio = f"{median / ours:8.2f}" if ours is not None else 8 * " "
        end = f" {found['log_mb']:7.1f}" if "log_mb" in found else ""
        if case != "master" and "away" in found:
            end += f"  {found['away']:.0e}"
        if found.get("missing"):
            end += f"  without {found['missing']} inputs"
        least = _per_step(found, min)
        print(f"{CASES[case].label:30} {median:6.1f} {least:7.1f}   {ratio} {setup:8.2f}{end}")
    print(DIFFERENCES)


def _report_parts(cases: dict[str, Any]) -> None:
    parts = ("master", "no_faults", "no_log", "neither", "fmi", "components")
    if not {*parts} <= {*cases}:
        return
    if any("error" in cases[case] for case in parts):
        for case in parts:
            if "error" in cases[case]:
                print(f"\n{CASES[case].label}: {cases[case]['error']}")
        return
    full, no_faults, no_log, neither, fmi, components = (_per_step(cases[case], min) for case in parts)
    print("\nWhere the time of this master goes (differences of minima)     us per step    share")
    for label, value in (
        ("step functions of the components, in Python", components),
        ("FMI calls: fmus/slave.py, PythonFMU, ctypes", fmi - components),
        ("master: transfers, checks, the loop", neither - fmi),
        ("faults, and what they make the observer do", (full - no_faults + no_log - neither) / 2),
        ("log", (full - no_log + no_faults - neither) / 2),
        ("all", full),
    ):
        print(f"  {label:58} {value:13.1f} {value / full:8.0%}")
