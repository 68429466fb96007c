"""The smoother gives the same on every processor: kernels of the linear algebra, and their threads, differ
by rounding alone, and rounding must not show."""

import os
import pickle
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from support.measured import sail

HERE = Path(__file__).parent
SMOOTH = """
import pickle, sys
from diagnosis import clean, smooth

for run in pickle.load(open(sys.argv[1], "rb")):
    s = smooth(clean(run))
    print(*s.jerk, s.delay, *s.counts, *s.nu[::50].ravel(), *s.nu_std[::50].ravel())
"""
# OpenBLAS' kernels, and the flag of a processor that can run them.
KERNELS = {"SkylakeX": "avx512f", "Haswell": "avx2", "Zen": "avx2", "Sandybridge": "avx"}


def kernels():
    info = Path("/proc/cpuinfo")
    flags = set(info.read_text().split()) if info.exists() else set()
    return [name for name, flag in KERNELS.items() if flag in flags]


def numbers(runs, kernel, threads):
    """What a process prints of runs with a kernel and some threads, and what OpenBLAS says it uses."""
    env = {"OPENBLAS_CORETYPE": kernel, "OPENBLAS_NUM_THREADS": str(threads), "OPENBLAS_VERBOSE": "2"}
    env["PYTHONPATH"] = os.pathsep.join([str(HERE), str(HERE.parent)])
    done = subprocess.run(
        [sys.executable, "-c", SMOOTH, runs],
        env=os.environ | env,
        capture_output=True,
        text=True,
        check=True,
    )
    text = (done.stdout + done.stderr).splitlines()
    lines = [np.array(line.split(), float) for line in text if not line.startswith("Core:")]
    return lines, {line for line in text if line.startswith("Core:")}


@pytest.mark.slow
def test_kernel_and_threads_do_not_show(tmp_path):
    names = kernels()
    if len(names) < 2:
        pytest.skip("no binary for this processor's linear algebra to choose kernels from")
    cases = [(name, threads) for k, name in enumerate(names) for threads in ((1, 2) if k == 0 else (2,))]
    runs = tmp_path / "runs"
    runs.write_bytes(pickle.dumps([sail(40.0)[0]]))
    found = [numbers(runs, *case) for case in cases]
    if len(set().union(*(used for _, used in found))) < 2:
        pytest.skip("no binary of OpenBLAS that heeds OPENBLAS_CORETYPE")
    (first, _), *others = found
    for lines, _ in others:
        for a, b in zip(lines, first, strict=True):
            jerk, rest = slice(0, 3), slice(3, None)
            np.testing.assert_allclose(a[jerk], b[jerk], rtol=1e-9)
            np.testing.assert_allclose(a[rest], b[rest], rtol=0.0, atol=1e-9)
