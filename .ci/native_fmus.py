"""Compiles the project's FMUs for a wheel, and loads and steps each: ``native_fmus.py FOLDER``.

Without a compiler of the system in the PATH zig compiles, for every glibc since 2.17. Nothing is shipped
if one does not give the numbers of its FMU in Python.
"""

import sys
from pathlib import Path

import numpy as np
from fmpy import simulate_fmu

from fmus.build import build, native_targets
from fmus.build.building import own_source
from fmus.build.released import release

fmus = build([], native=native_targets())
for compiled, python in zip(fmus, build([]), strict=True):
    rows = [simulate_fmu(str(f), stop_time=1.0, output_interval=0.01) for f in (compiled, python)]
    if not np.array_equal(*(np.array(r.tolist()) for r in rows), equal_nan=True):
        sys.exit(f"{compiled.name}: compiled and in Python it gives different numbers")
release(fmus, own_source(), Path(sys.argv[1]))
