"""Tests that took long when they were measured: ``python tests/support/slow_tests.py junit.xml...``.

Reads the processor times of ``python -m pytest -n auto --junitxml junit.xml`` and writes ``slow_tests.txt``, whose
tests are marked slow besides those that say so themselves. Those marked ``quick`` stay in the quick part, and
numerical ones, as the gate runs them as on several processors. A run may be in several parts, with a report each.
"""

import sys
from collections.abc import Iterator
from pathlib import Path
from xml.etree import ElementTree

LIST = Path(__file__).parents[1] / "slow_tests.txt"
LONG = 0.2  # s; chosen: all that take less, with their start, need 250 s of processor time, two minutes on two cores
PROCESSOR, NODE = "processor_s", "node_id"  # what the report calls them


def slow_tests() -> frozenset[str]:
    """Node ids of the list."""
    lines = LIST.read_text(encoding="utf-8").splitlines()
    return frozenset(line for line in lines if line and not line.startswith("#"))


def long_ones(report: Path) -> Iterator[str]:
    """Node ids of the tests of a report that took longer than LONG."""
    for case in ElementTree.parse(report).iter("testcase"):
        stated = {p.get("name"): p.get("value", "") for p in case.iter("property")}
        if float(stated.get(PROCESSOR, "0")) > LONG:
            yield stated[NODE]


if __name__ == "__main__":
    header = f"# Took longer than {LONG} s of processor time; written by support/slow_tests.py."
    long = {node for report in sys.argv[1:] for node in long_ones(Path(report))}
    LIST.write_text("\n".join([header, *sorted(long)]) + "\n", encoding="utf-8")
