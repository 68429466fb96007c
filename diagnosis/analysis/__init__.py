"""The thesis' own analysis of measured runs, chapters 3 and 7: PCA, PLS, SysID by concurrent learning.

Samples of velocity, force and model error are organised (:mod:`.organisation`) and analysed; a model
of the model error goes back into the ship by the effect ``linear_map``::

    runs = gather_samples(["run1.csv", "run2.csv"])
    found = regressed(joined(runs), recipe("PLS3"))
    diagnosis.model.write_model(Path("model.ssv"), as_model(found.c, found.B, found.columns))
"""

from .analysis_figures import (
    before_and_after,
    coefficient_bars,
    loadings,
    model_error_over_time,
    share_of_variance,
)
from .concurrent_passes import (
    GAMMA,
    Identified,
    explained,
    fences,
    identify,
    material,
    one_pass,
    regressors,
)
from .constrained_fit import Stable, nearest_stable
from .into_the_plant import EffectiveThrust, as_model, effective_thrust, goes_into_the_plant, thrust_of
from .outlier_report import analyse, sentences
from .partial_least_squares import Regressed, regressed
from .pls_report import correlations
from .principal_components import PrincipalComponents, fit_components, outliers, removals
from .recipes import RECIPES, Recipe, recipe
from .samples import (
    NU,
    OMEGA,
    SETTLED,
    TAU,
    Samples,
    by_run,
    gather_samples,
    joined,
    model_error,
    without_outliers,
)
from .table_7_1 import NAMES, TABLE_7_1, plant, row

__all__ = [
    "GAMMA",
    "NAMES",
    "NU",
    "OMEGA",
    "RECIPES",
    "SETTLED",
    "TABLE_7_1",
    "TAU",
    "EffectiveThrust",
    "Identified",
    "PrincipalComponents",
    "Recipe",
    "Regressed",
    "Samples",
    "Stable",
    "analyse",
    "as_model",
    "before_and_after",
    "by_run",
    "coefficient_bars",
    "correlations",
    "effective_thrust",
    "explained",
    "fences",
    "fit_components",
    "gather_samples",
    "goes_into_the_plant",
    "identify",
    "joined",
    "loadings",
    "material",
    "model_error",
    "model_error_over_time",
    "nearest_stable",
    "one_pass",
    "outliers",
    "plant",
    "recipe",
    "regressed",
    "regressors",
    "removals",
    "row",
    "sentences",
    "share_of_variance",
    "thrust_of",
    "without_outliers",
]
