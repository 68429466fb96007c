"""The thesis' own analysis of measured runs, chapters 3 and 7: PCA, PLS, SysID by concurrent learning.

Samples of velocity, force and model error are organised (:mod:`.organisation`) and analysed; a model
of the model error goes back into the ship by the effect ``linear_map``.
"""

from .samples import Samples, gather_samples

__all__ = ["Samples", "gather_samples"]
