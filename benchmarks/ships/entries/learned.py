"""This project: ``learn``, with the search for effects."""

import diagnosis

from ..entry_predictor import OfModel, Training


def fit(train: Training) -> OfModel:
    """The learned model with its bands, or the initial one where nothing is found."""
    found = diagnosis.diagnose(train.runs, model=train.model)
    return OfModel(found.learned.model if found.changed else train.model, found.bands)
