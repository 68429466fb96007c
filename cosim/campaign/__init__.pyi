from .comparison import differences as differences
from .comparison import pareto as pareto
from .conduct import run_campaign as run_campaign
from .ensemble import run_ensemble as run_ensemble
from .posterior import Posterior as Posterior
from .posterior import read_posterior as read_posterior
