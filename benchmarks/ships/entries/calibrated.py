"""This project without effects: ``learn --quick``, the coefficients alone."""

import diagnosis

from ..entry_predictor import OfModel, Training


def fit(train: Training) -> OfModel:
    """The calibrated model with its bands, or the initial one where the runs determine nothing."""
    found = diagnosis.begin(train.runs, model=train.model).calibration
    return OfModel(train.model) if found is None else OfModel(found.findings.model, found.bands)
