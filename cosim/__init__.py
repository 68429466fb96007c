"""A co-simulation master for FMI 2.0: connects FMUs, injects faults, logs, measures.

It reads ``.fmu`` files and knows nothing of what is inside them. ``python -m cosim.run SCENARIO``
runs a scenario; from Python::

    import cosim

    result = cosim.simulate("ellipse", seed=3, set={"vessel.m": 15.0})
    result.metrics["e_pos_rms"]  # m
    result.log["vessel.x"]  # a column of a table, whose attrs["units"] tell its unit
    result.plot("errors").save("errors.svg")

The packages below, each using only those before it: ``compiled`` (C for the step loop and the log),
``fmu`` (one FMU), ``formats`` (files of the SSP and OSP standards), ``scenario`` (the user's input),
``system`` (a scenario checked against its FMUs), ``results`` (log, metrics, pictures), ``trials``
(manoeuvring trials and their measures), ``master`` (the run), ``dispatch`` (runs in many processes),
``campaign`` (many runs and their table), ``export`` (systems for other tools).
"""

from .lazy import lazy_names

__all__, __getattr__, __dir__ = lazy_names(__name__, __file__)
