from .analysed_run import FinishedRun as FinishedRun
from .analysed_run import analyse_runs as analyse_runs
