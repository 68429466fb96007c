"""The thesis' own analysis of measured runs, chapters 3 and 7: PCA, PLS, SysID by concurrent learning.

Samples of velocity, force and model error are organised (:mod:`.organisation`) and analysed; a model
of the model error goes back into the ship by the effect ``linear_map``::

    runs = gather_samples(["run1.csv", "run2.csv"])
    found = regressed(joined(runs), recipe("PLS3"))
    diagnosis.predictors.write_model(Path("model.ssv"), as_model(found.c, found.B, found.columns))
"""

from cosim.lazy import lazy_names

__all__, __getattr__, __dir__ = lazy_names(__name__, __file__)
