"""Many runs of a scenario that differ by named axes, on one or many computers, and one table of them.

``python -m cosim.campaign campaign.json``; from Python :func:`cosim.run_campaign`. Needs the extra
``campaign``.
"""

from ..lazy import lazy_names

__all__, __getattr__, __dir__ = lazy_names(__name__, __file__)
