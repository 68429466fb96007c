"""Compares a ship model with measurements, and learns from them what it lacks.

A measured run goes through three steps, each model-free, before it is compared with a model::

    import diagnosis

    track = diagnosis.clean(diagnosis.read("run.csv"))  # what is missing, frozen, out of order
    smoothed = diagnosis.smooth(track)  # pose, velocity, acceleration, and how sure they are
    windows = diagnosis.Windows([smoothed])  # of some seconds, in which models are compared with the run
    nominal = windows.errors()
    slower = windows.errors(diagnosis.Model(vessel={"delta_X_u": -4.0}))

or all at once, as ``python -m diagnosis.learn`` does it::

    runs = diagnosis.load(["run1.csv", "run2.csv"])
    d = diagnosis.diagnose(runs[:1], held_out=runs[1:])
    print(d)  # in ten lines; in a notebook ``d`` shows itself with pictures
    d.plot.where().save("where.svg")
    d.to_ssv("model.ssv")
"""

from importlib import import_module

TYPE_CHECKING = False  # as type checkers know it: importing typing takes longer than all of this file
if TYPE_CHECKING:
    from cosim import InputError

    from .assessment.evaluation import Evaluation, PredictionError, evaluate_run
    from .assessment.stability import Stability, check_stability
    from .assessment.windows import WindowErrors, Windows
    from .data import Counts, Run, Track, clean, read
    from .gathering import gather
    from .identification import Finding, Findings, method
    from .interactive import ShownDiagnosis, diagnose, load
    from .model import Integrals, Model, integrals, omega, read_model, write_model
    from .model.uncertainty import omega_std
    from .report.content import comparison_content, diagnosis_content
    from .report.result_keys import ComparisonContent, DiagnosisContent, EffectResult
    from .session import Comparison, Diagnosis, evaluate
    from .smoothing import Smoothed, smooth

__all__ = [
    "Comparison",
    "ComparisonContent",
    "Counts",
    "Diagnosis",
    "DiagnosisContent",
    "EffectResult",
    "Evaluation",
    "Finding",
    "Findings",
    "InputError",
    "Integrals",
    "Model",
    "PredictionError",
    "Run",
    "ShownDiagnosis",
    "Smoothed",
    "Stability",
    "Track",
    "WindowErrors",
    "Windows",
    "check_stability",
    "clean",
    "comparison_content",
    "diagnose",
    "diagnosis_content",
    "evaluate",
    "evaluate_run",
    "gather",
    "integrals",
    "load",
    "method",
    "omega",
    "omega_std",
    "read",
    "read_model",
    "smooth",
    "write_model",
]

_HOME = {
    "InputError": "cosim",
    "Counts": "diagnosis.data",
    "Track": "diagnosis.data",
    "clean": "diagnosis.data",
    "gather": "diagnosis.gathering",
    "Finding": "diagnosis.identification.findings",
    "Findings": "diagnosis.identification.findings",
    "method": "diagnosis.identification.methods",
    "Integrals": "diagnosis.model",
    "Model": "diagnosis.model",
    "integrals": "diagnosis.model",
    "omega": "diagnosis.model",
    "Comparison": "diagnosis.session",
    "Diagnosis": "diagnosis.session",
    "ShownDiagnosis": "diagnosis.interactive",
    "diagnose": "diagnosis.interactive",
    "load": "diagnosis.interactive",
    "read_model": "diagnosis.model",
    "write_model": "diagnosis.model",
    "evaluate": "diagnosis.session",
    "Run": "diagnosis.data",
    "read": "diagnosis.data",
    "Smoothed": "diagnosis.smoothing",
    "smooth": "diagnosis.smoothing",
    "Evaluation": "diagnosis.assessment.evaluation",
    "PredictionError": "diagnosis.assessment.evaluation",
    "evaluate_run": "diagnosis.assessment.evaluation",
    "Stability": "diagnosis.assessment.stability",
    "check_stability": "diagnosis.assessment.stability",
    "omega_std": "diagnosis.model.uncertainty",
    "WindowErrors": "diagnosis.assessment.windows",
    "Windows": "diagnosis.assessment.windows",
    "ComparisonContent": "diagnosis.report.result_keys",
    "DiagnosisContent": "diagnosis.report.result_keys",
    "EffectResult": "diagnosis.report.result_keys",
    "comparison_content": "diagnosis.report.content",
    "diagnosis_content": "diagnosis.report.content",
}


def __getattr__(name: str) -> object:
    """Import on demand, so that a command pays only for what it uses."""
    if name not in _HOME:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(_HOME[name]), name)


def __dir__() -> list[str]:
    """The public names, also those that are not imported yet."""
    return sorted(__all__)
