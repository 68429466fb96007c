"""What the page of a report needs to predict the windows itself while a reader moves coefficients.

One text holds all of it, compressed: the step of a prediction as WebAssembly, of each run the windows'
start states and inputs and the measured pose, and the coefficients. The program in ``templates/what_if``
reads it.
"""

import json
import zlib
from base64 import b64encode
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from hashlib import sha256
from math import inf, isfinite
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from cosim import InputError
from fmus.effects import Effect
from fmus.fmi.trace import TraceError
from fmus.native.program import program
from fmus.native.webassembly import component_module

from ..execution.short_text import SHOWN
from ..predictors import Evaluation, Model, Response, write_model
from ..predictors.prediction import FAR_OFF
from ..predictors.ship_model import of_run, parameter_and_run
from ..predictors.thrust import LONGEST_STEP
from ..predictors.traced.balance_component import balance_component
from ..predictors.traced.prediction_component import START, allocation_component, prediction_component
from ..predictors.weak_form import response
from ..predictors.windows import WindowStarts
from ..runs.cleaning import WIDTH, Z95
from ..search.prior import NominalPrior
from ..session import Diagnosis
from .formatting import finite
from .pictures.figures import MOST_RANKED
from .report_data import ReportData

if TYPE_CHECKING:
    from markupsafe import Markup

SCRIPTS = Path(__file__).parent / "templates" / "what_if"
# Files of the page's program, in this order.
PROGRAM = ("data", "predictions", "residual_force", "fit", "own_run", "pictures", "results", "controls")
FIXED = "It changes the delay or the filter of commands or of the measurement: it stays as it is here."


class Slider(NamedTuple):
    """A value that a reader may move.

    Attributes:
        name, part: of the parameter, and of the component that has it.
        nominal: value of the FMU, which a file leaves out.
        param: its place among the parameters of the step.
        run: number of the run in which alone it holds; -1: all.
        before, after: in the initial and in the learned model, or where a reader begins.
        low, high: ends of the slider.
        ci95: interval of the value; None: there is none.
        std: of its prior; None: it has none.
        limits: that the FMU accepts; None: no limit.
    """

    name: str
    part: str
    unit: str
    description: str
    param: int
    run: int
    nominal: float
    before: float
    after: float
    low: float
    high: float
    ci95: tuple[float, float] | None
    std: float | None
    limits: tuple[float | None, float | None]


class Choice(NamedTuple):
    """What is ticked at once: an effect, or a nominal coefficient.

    ``fixed`` states why it cannot be moved; empty: it can.
    """

    name: str
    effect: bool
    note: str
    ticked: bool
    fixed: str
    sliders: Sequence[Slider]


class WhatIf(NamedTuple):
    """The text for the page; empty where ``missing`` states why there is none."""

    content: str = ""
    missing: str = ""

    @property
    def script(self) -> "Markup":
        """The program of the page, which is no text of a user."""
        from markupsafe import Markup

        files = ((SCRIPTS / f"{name}.js").read_text(encoding="utf-8") for name in PROGRAM)
        return Markup("\n".join(files))

    @property
    def policy(self) -> "Markup":
        """What the page may run: this program, and the module that it makes."""
        from markupsafe import Markup

        digest = b64encode(sha256(self.script.encode()).digest()).decode()
        return Markup(f"; script-src 'sha256-{digest}' 'wasm-unsafe-eval'" if self.content else "")


def what_if(r: ReportData) -> WhatIf:
    """What the page needs to predict the windows of a diagnosis; nothing for a comparison."""
    if r.diagnosis is None or not any(e.windows for e in r.evaluations):
        return WhatIf()
    if not r.comparison.predictor.parametric:
        return WhatIf(missing="the model is not a described ship, so the page cannot compute it")
    movable = MovableModel(r)
    if movable.learned.filters:
        return WhatIf(missing="the pose was measured behind a filter, which the page does not have")
    each = (e.smoothed.track.run for e in movable.runs)
    if len({(run.signals, 0 if run.power is None else run.power.shape[1]) for run in each}) > 1:
        return WhatIf(missing="the runs have commands of different kinds")
    module = webassembly_of(movable)
    if module is None:
        return WhatIf(missing="an effect cannot be translated to WebAssembly")
    return WhatIf(movable.content(module))


def webassembly_of(movable: "MovableModel") -> bytes | None:
    """A step of the prediction with the parameters that can be moved; None: it cannot be translated."""
    run = movable.runs[0].smoothed.track.run
    try:
        made = prediction_component(movable.learned, movable.names, run, movable.windy)
        return component_module(program(made))
    except TraceError:
        return None


@dataclass(frozen=True, eq=False)
class MovableModel:
    """The runs, models and coefficients of a report.

    Attributes:
        r: the report.
        names: parameters that can be moved, in the order of their places in the step.
        choices: what can be ticked.
    """

    r: ReportData
    names: list[str] = field(default_factory=list)
    choices: list[Choice] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.choices.extend(self._choices())

    @property
    def diagnosis(self) -> Diagnosis:
        assert self.r.diagnosis is not None
        return self.r.diagnosis

    @property
    def runs(self) -> list[Evaluation]:
        """The runs that have windows."""
        return [e for e in self.r.evaluations if e.windows is not None]

    @property
    def start(self) -> Model:
        return self.r.comparison.predictor.model

    @property
    def learned(self) -> Model:
        """The learned model; the initial one where nothing was learned."""
        return self.runs[0].learned or self.start

    @property
    def windy(self) -> bool:
        return any(self._group(e).air(self.learned) is not None for e in self.runs)

    def content(self, module: bytes) -> str:
        """All of it as one text."""
        store = ArrayStore()
        runs = [self._run(e, store) for e in self.runs]
        header = {
            "params": self.names,
            "start": len(START),
            "choices": [
                c._replace(sliders=[s._asdict() for s in c.sliders])._asdict() for c in self.choices
            ],
            "runs": runs,
            "model": self._ssv(),
            "csv": self._csv(),
            "inertia": self.learned.reference_mass.tolist(),
            "arrays": store.entries,
        }
        head = json.dumps(finite(header), allow_nan=False).encode()
        allocation = component_module(program(allocation_component(self.learned)))
        run = self.runs[0].weak_windows.run
        balance = balance_component(self.learned, self.names, run, self._points)
        parts = head, module, allocation, component_module(program(balance))
        sizes = [len(part).to_bytes(4, "little") for part in parts]
        return b64encode(zlib.compress(b"".join([*sizes, *parts, *store.parts]))).decode()

    def _ssv(self) -> str:
        """The learned model as a file, with all that can be moved; empty if no FMU would accept it."""
        every = [s for c in self.choices if not c.fixed for s in c.sliders if s.run < 0]
        nominal = {
            s.name: 0.5 * (s.high - s.after) or s.low - s.after
            for s in every
            if s.nominal == self.learned.value(s.name)
        }
        with TemporaryDirectory() as folder:
            path = Path(folder) / "model.ssv"
            try:
                write_model(path, self.learned.plus(nominal))
            except InputError:
                return ""
            return path.read_text(encoding="utf-8")

    def _csv(self) -> dict[str, Any] | None:
        """What the page needs to predict a run of the reader's own; None where commands are delayed,
        have power settings, or a wind acts."""
        run, w, model = self.runs[0].smoothed.track.run, self.runs[0].weak_windows, self.learned
        if Response(run, model).slow or any(model.logging) or self.windy or run.power is not None:
            return None
        return {
            "columns": [*run.commanded],
            "force": run.commands is None,
            "length": w.horizon,
            "longest": LONGEST_STEP * w.scale.time,
            "reach": WIDTH / 4 * w.scale.time,  # on both sides of a start, without a smoother
        }

    # Coefficients.

    def _choices(self) -> Iterator[Choice]:
        effects, done = self.start.ship.effects, set[str]()
        for e in self.r.accepted:
            done.add(e.id)
            stated = {n: c.value for n, c in e.coefficients.items()}
            note = "found" if e in self.r.effects else "possibility"
            yield self._choice(effects[e.id], note, stated, e.in_model)
        prior = NominalPrior.of(self.start, self.diagnosis.prior)
        # Terms that a calibration fits in addition to the ship's coefficients.
        for effect in effects.values():
            free = [p.name for p in effect.parameters if p.name not in prior.std]
            if effect.id not in done and any(self.learned.value(n) != self.start.value(n) for n in free):
                done.add(effect.id)
                yield self._choice(effect, "calibrated", {}, True)
        for ranked in self.r.ranking[:MOST_RANKED]:
            effect = effects[ranked.id]
            if ranked.id not in done and len(effect.parameters) <= 2 * SHOWN and effect.function:
                yield self._choice(effect, "candidate", {}, False)
        for name, std in prior.std.items():
            if std or self.learned.value(name) != self.start.value(name):
                slider = self._slider(name, self.learned.value(name), std)
                yield Choice(name, False, "", slider.before != slider.after, *self._movable([slider]))

    def _choice(self, effect: Effect, note: str, stated: dict[str, float], in_model: bool) -> Choice:
        """An effect with its values: those of the model that has it, else those that are reported."""
        free = [p.name for p in effect.parameters if p.name not in effect.settings]
        single = {p for own in self.learned.runs.values() for p in own}
        of_runs = [n for e in self.runs for p in free for n in [of_run(p, e.name)]
                   if p in self.learned.runs.get(e.name, {})
                   or (p in single and self.learned.value(n) != self.start.value(n))]  # fmt: skip
        sliders = []
        for name in (*(n for n in free if n not in single), *of_runs):
            present = self.start.value(name)
            given = (
                stated.get(name, 0.0) + present
                if name in effect.coefficients
                else stated.get(name, present)
            )
            sliders.append(self._slider(name, self.learned.value(name) if in_model else given, None))
        return Choice(effect.id, True, note, in_model, *self._movable(sliders))

    def _slider(self, name: str, after: float, std: float | None) -> Slider:
        parameter, run = parameter_and_run(name)
        declared, before = self.start.declared(name), self.start.value(name)
        posterior = self.diagnosis.posterior.std
        ci95 = (
            (after - Z95 * posterior[name], after + Z95 * posterior[name]) if name in posterior else None
        )
        away = [
            FAR_OFF * abs(after - before),
            *(abs(x - before) for x in ci95 or ()),
            FAR_OFF * (std or 0.0),
        ]
        reach = max(away) or self.start.unit(name)
        low, high = declared.range.min, declared.range.max
        return Slider(
            name,
            self.start.owner(parameter),
            declared.unit,
            declared.description,
            -1,
            [e.name for e in self.runs].index(run) if run else -1,
            declared.start,
            before,
            after,
            max(before - reach, -inf if low is None else low),
            min(before + reach, inf if high is None else high),
            ci95,
            std or None,
            (low, high),
        )

    def _movable(self, sliders: Sequence[Slider]) -> tuple[str, list[Slider]]:
        """Why some sliders cannot be moved, else nothing; and the sliders with their places."""
        model = self.learned
        for s in sliders:
            moved = model.plus({s.name: 0.01 * (s.high - s.low)})
            same = Response.key(moved) == Response.key(model) and moved.filters == model.filters
            if not (same and isfinite(s.before) and isfinite(s.after)):
                return FIXED, [*sliders]
        placed = []
        for s in sliders:
            parameter, _ = parameter_and_run(s.name)
            if parameter not in self.names:
                self.names.append(parameter)
            placed.append(s._replace(param=self.names.index(parameter)))
        return "", placed

    # Runs.

    def _group(self, e: Evaluation) -> WindowStarts:
        """The windows of a run, as they are predicted."""
        assert e.windows is not None
        ((starts, _),) = e.windows.groups
        return starts

    def _run(self, e: Evaluation, store: "ArrayStore") -> dict[str, Any]:
        """A run for the page; arrays by their numbers."""
        starts, windows, model = self._group(e), e.windows, self.learned.during(e.name)
        assert windows is not None
        assert e.before.errors is not None
        given, acting = (np.moveaxis(x[:, :, 0], -1, 0) for x in starts.arriving(model))
        shape = (*given.shape[:2], -1)
        parts = [given, acting]
        power, air = starts.power(model.clock), starts.air(model) if self.windy else None
        if power is not None:
            parts.append(np.moveaxis(power, -1, 0))
        if self.windy:
            wind = np.zeros((*shape[:2], 2)) if air is None else np.moveaxis(air[:, :, 0], -1, 0)
            parts.append(wind)
        columns = np.concatenate([x.reshape(shape) for x in parts], axis=2)
        pose, rate = starts.motion(model)
        begin = np.concatenate([pose, rate, starts.first(lambda s: s.time)[None]]).T
        base = (
            replace(self.start, runs={}) if e.name not in self.start.runs else self.start.during(e.name)
        )
        found = {} if self.windy else {"force": self._force(e, store)}
        smooth = e.smoothed.eta[np.isfinite(e.smoothed.eta[:, 0])]
        return found | {
            "name": e.name,
            "use": self.r.use(e),
            "train": e.use == "train",
            "h": starts.h,
            "steps": starts.steps,
            "windows": len(begin),
            "base": [base.value(n) for n in self.names],
            "begin": store.exact(begin),
            "given": [store.near(x) for x in columns.reshape(-1, columns.shape[2]).T],
            "samples": e.before.errors.samples.tolist(),
            "since": store.exact(windows.since),
            "measured": [store.near(x) for x in windows.measured.T],
            "track": [store.near(x) for x in smooth[:: max(1, len(smooth) // 1500), :2].T],
            "before": [e.before.position, e.before.heading],
            "after": [e.after.position, e.after.heading],
        }

    @cached_property
    def _points(self) -> int:
        """At how many points from a sample to the next shares act, in any run."""
        return max(len(self._between(e)) - 1 for e in self.runs) or 1

    def _between(self, e: Evaluation) -> np.ndarray:
        """(points, k, n): commands that arrive, then shares that act; or one for both."""
        w = e.weak_windows.thinned
        return response(w, self.learned.during(e.name))

    def _force(self, e: Evaluation, store: "ArrayStore") -> dict[str, Any]:
        """What the page needs for the model error of a run, see :mod:`..predictors.weak_form`."""
        w, between = e.weak_windows.thinned, self._between(e)
        given, *acting = between if len(between) > 1 else [between[0]] * 2
        acting = [acting[k % len(acting)] for k in range(self._points)]
        power = [] if w.run.power is None else [*w.run.power.T]
        motion = np.where(w.known[:, None], np.hstack([w.smoothed.eta, w.smoothed.eta_dot]), 0.0)
        columns = [*given, *(x for shares in acting for x in shares), *power]
        first = w.smooth.indptr[:-1]
        return {
            "time": store.exact(w.run.time),
            "motion": [store.near(x) for x in motion.T],
            "columns": [store.near(x) for x in columns],
            "middle": store.exact(w.middle),
            "half": 0.5 * w.width,
            "first": w.smooth.indices[first].tolist() if first.size else [],
            "rows": np.diff(w.smooth.indptr).tolist(),
            "after": e.after.omega_rms.tolist() if first.size else [],
        }


class ArrayStore:
    """Arrays one after the other, and where each is."""

    def __init__(self) -> None:
        self.parts: list[bytes] = []
        self.entries: list[dict[str, Any]] = []
        self._known: dict[tuple[bytes, float], int] = {}

    def exact(self, values: np.ndarray) -> int:
        """The number of an array that keeps every bit."""
        whole = np.ascontiguousarray(values, "<f8").reshape(-1)
        return self._keep(whole.view(np.uint8).reshape(-1, 8), 0.0)

    def near(self, values: np.ndarray) -> int:
        """The number of an array, kept to a 2^31st of its largest value as second differences."""
        scale = float(np.abs(values).max(initial=0.0)) / np.iinfo(np.int32).max or 1.0
        whole = np.round(values / scale).astype(np.int64)
        change = np.diff(np.diff(whole, prepend=0), prepend=0).astype("<i4")  # modulo 2^32
        return self._keep(change.view(np.uint8).reshape(-1, 4), scale)

    def _keep(self, rows: np.ndarray, scale: float) -> int:
        """Bytes of the same weight next to each other, which compresses."""
        content = rows.T.tobytes()
        if (content, scale) not in self._known:
            self._known[content, scale] = len(self.entries)
            self.parts.append(content)
            self.entries.append({"count": len(rows), "scale": scale})
        return self._known[content, scale]
