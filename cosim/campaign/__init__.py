"""Many runs of a scenario that differ by named axes, on one or many computers, and one table of them.

``python -m cosim.campaign campaign.json``; from Python :func:`cosim.run_campaign`. Needs the extra
``campaign``.
"""

from ..lazy import lazy_names

TYPE_CHECKING = False  # typing itself takes a while to import
if TYPE_CHECKING:
    from .campaign_file import campaign_schema
    from .comparison import differences, pareto
    from .conduct import run_campaign
    from .ensemble import run_ensemble
    from .posterior import Posterior, read_posterior

__all__ = [
    "Posterior",
    "campaign_schema",
    "differences",
    "pareto",
    "read_posterior",
    "run_campaign",
    "run_ensemble",
]

__getattr__ = lazy_names(
    __name__,
    {
        "campaign_schema": "campaign_file",
        "differences": "comparison",
        "pareto": "comparison",
        "run_campaign": "conduct",
        "Posterior": "posterior",
        "read_posterior": "posterior",
        "run_ensemble": "ensemble",
    },
)
