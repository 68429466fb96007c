"""Compares a ship model with measurements, and learns from them what it lacks.

A measured run goes through three steps, each model-free, before it is compared with a model::

    import diagnosis

    track = diagnosis.clean(diagnosis.read("run.csv"))  # what is missing, frozen, out of order
    smoothed = diagnosis.smooth(track)  # pose, velocity, acceleration, and how sure they are
    windows = diagnosis.Windows([smoothed])  # of some seconds, in which models are compared with the run
    nominal = windows.errors()
    slower = windows.errors(diagnosis.Model(vessel={"delta_X_u": -4.0}))

or all at once, as ``python -m diagnosis.learn`` does it::

    runs = diagnosis.load(["run1.csv", "run2.csv"])
    d = diagnosis.diagnose(runs[:1], held_out=runs[1:])
    print(d)  # in ten lines; in a notebook ``d`` shows itself with pictures
    d.plot.where().save("where.svg")
    d.to_ssv("model.ssv")
"""

from cosim.lazy import lazy_names

from .moved import keep_old_names

__all__, __getattr__, __dir__ = lazy_names(__name__, __file__)
keep_old_names()
