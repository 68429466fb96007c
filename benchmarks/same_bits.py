"""Do native FMUs and Python FMUs give the same log, byte for byte? ``python -m benchmarks.same_bits``.

Runs each shipped scenario with both, as many steps as are asked for whatever its end, with its faults
and events; exit code 1 if a log differs.
"""

import argparse
import hashlib
import json
import sys
from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryDirectory

ROOT = Path(__file__).parent.parent


def log_of(scenario: Path, steps: int, native: bool) -> tuple[str, int, str]:
    """How a run ends, its rows, and the SHA-256 of its log."""
    import cosim
    from cosim.scenario import with_settings

    stop = steps * json.loads(scenario.read_text())["step"]
    changes = [("stop", stop), ("metrics", {}), ("native", native)]
    varied = with_settings(cosim.load_scenario(scenario), changes, scenario.parent)
    with TemporaryDirectory(prefix="same_bits_") as folder:
        result = cosim.simulate(varied, folder)
        log = Path(folder, "log.csv").read_bytes()
    return result.status, result.rows, hashlib.sha256(log).hexdigest()


def main(arguments: Sequence[str] | None = None) -> int:
    """Command line; returns the exit code."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.same_bits", description=__doc__)
    shipped = sorted((ROOT / "scenarios").glob("*.json"))
    parser.add_argument("scenarios", nargs="*", type=Path, default=shipped, help="(all shipped ones)")
    parser.add_argument("--steps", type=int, default=20_000, help="of each (20000)")
    options = parser.parse_args(arguments)
    good = True
    for scenario in options.scenarios:
        native, python = (log_of(scenario, options.steps, kind) for kind in (True, False))
        good &= native == python
        stated = "the same" if native == python else "DIFFER"
        print(f"{scenario.stem:20} {native[0]}, {native[1]} rows: {stated}", flush=True)
    return 0 if good else 1


if __name__ == "__main__":
    sys.exit(main())
