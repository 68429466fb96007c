"""Harm by an information criterion: the deviance on the data that decide, plus a charge per parameter.

The model error of a block, in units of its noise, is a sum of squares whose difference between two
models is twice a log likelihood ratio. The charge is that of the Bayesian information criterion, log n
for n blocks (G. Schwarz, Estimating the dimension of a model, Annals of Statistics 6, 1978). Predictions
are not asked.
"""

import numpy as np

from ..search.significance import Losses

CHARGED = "the model fits {where} worse, or not better by the cost of its parameters (BIC)"


def harm(its: Losses, others: Losses, more: int) -> str:
    """Whether a model has the higher criterion; arguments and result as of :class:`.Harm`."""
    known = np.isfinite(others.omega)
    difference = float(np.sum((its.omega - others.omega)[known]))
    return CHARGED if not difference + more * np.log(max(its.omega.size, 1)) <= 0.0 else ""
