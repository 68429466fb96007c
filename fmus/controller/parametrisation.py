"""What of the hull's dynamics a controller knows, and what it learns, 2.2.

The force on the hull is known + F phi + R^T omega_n + tau = M nu_dot: F = -Phi holds the regressors.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, Generic, NamedTuple, Protocol, TypeVar

from ..declare import Fields, FirstEstimate, Range, Variable, group_of
from ..hull import Inertia, TowedDamping, Triple, inertia_force
from ..ops import Number, clip, cos, sin

GAIN = Range(0.0, 1000.0)
# A thruster loss beyond these is not compensated for.
LOSS = (-1.0, 0.8)

# One tuple of regressors for each axis, aligned with the pattern.
Regressors = tuple[tuple[Number, ...], tuple[Number, ...], tuple[Number, ...]]


class LearnedCoefficient(NamedTuple):
    """A parameter that is learned: its true value for the default vessel, and an adaptation gain.

    ``added`` is whether it is learned what is to be added to the controller model.
    """

    parameter: str
    unit: str
    description: str
    value: float
    gain: float
    added: bool = False

    @property
    def name(self) -> str:
        return f"{self.parameter}, added" if self.added else self.parameter

    @property
    def estimate(self) -> FirstEstimate:
        return FirstEstimate(self.parameter, self.added)


class ControllerModel(NamedTuple):
    """The model of the hull in a controller: M, C(nu) and g(nu) of (2.27)."""

    inertia: Inertia = Inertia()
    towed: TowedDamping = TowedDamping()


class KnownHull(Protocol):
    """What a controller knows of the hull."""

    @property
    def inertia(self) -> Inertia: ...


B = TypeVar("B", bound=KnownHull)


def _written_out(arguments: str, sums: Sequence[Sequence[str]]) -> Any:
    """A function that gives a tuple of sums, without a loop: that would cost more than the sums."""
    terms = [" + ".join(["0.0", *products]) for products in sums]
    return eval(f"lambda {arguments}: ({', '.join(terms)},)")


@dataclass(frozen=True, eq=False)
class Parametrisation(Generic[B]):
    """A model M nu_dot = tau + known + F phi.

    Attributes:
        coefficients: the n parameters phi.
        pattern: for surge, sway and yaw the indices of the parameters that act there.
        regressors: (velocity, acceleration, tau, controller_model) -> F: force on the hull by each
            parameter.
        known: (u, v, r, controller_model) -> known force on the hull [N, N, N m].
        blocks: groups of axes that share parameters; of equal groups one is enough.
        controller_model: known beforehand; has a field ``inertia``.
        loss: index of the thruster loss of each axis, where it is learned.
    """

    coefficients: Sequence[LearnedCoefficient]
    pattern: tuple[tuple[int, ...], tuple[int, ...], tuple[int, ...]]
    regressors: Callable[[Triple, Triple, Triple, B], Regressors]
    known: Callable[[Number, Number, Number, B], Triple]
    blocks: tuple[tuple[int, ...], ...]
    controller_model: B = field(default_factory=ControllerModel)  # pyright: ignore[reportAssignmentType]
    loss: tuple[int, int, int] | None = None

    def _vector(
        self,
        stem: str,
        text: str,
        start: Callable[[LearnedCoefficient], float],
        estimate: Callable[[LearnedCoefficient], FirstEstimate | None] = lambda c: None,
    ) -> type[Fields]:
        """A NamedTuple class with one scalar for each parameter."""
        name = stem.title().replace("_", "")
        fields = [
            Variable(f"{stem}_{k}", c.unit, f"{text} {c.name}", start(c), estimate=estimate(c))
            for k, c in enumerate(self.coefficients, 1)
        ]
        return group_of(name, fields)

    @cached_property
    def start(self) -> type[Fields]:
        return self._vector("phi_0", "estimate at the start of", lambda c: 0.0, lambda c: c.estimate)

    @cached_property
    def hat(self) -> type[Fields]:
        return self._vector("phi_hat", "estimate of", lambda c: 0.0)

    @cached_property
    def truth(self) -> type[Fields]:
        return self._vector("phi_true", "for the output lyapunov only: true", lambda c: c.value)

    @cached_property
    def gamma(self) -> type[Fields]:
        fields = [
            Variable(f"gamma_{k}", "1", f"adaptation gain of {c.name}", c.gain, GAIN)
            for k, c in enumerate(self.coefficients, 1)
        ]
        return group_of("Gamma", fields)

    @cached_property
    def force(self) -> Callable[[Regressors, Sequence[Number]], Triple]:
        """(F, phi) -> F phi [N, N, N m]."""
        return _written_out(
            "F, phi",
            [
                [f"F[{axis}][{j}] * phi[{k}]" for j, k in enumerate(indices)]
                for axis, indices in enumerate(self.pattern)
            ],
        )

    @cached_property
    def project(self) -> Callable[[Regressors, Triple], tuple[Number, ...]]:
        """(F, e) -> F^T e, one entry for each parameter."""
        sums: list[list[str]] = [[] for _ in self.coefficients]
        for axis, indices in enumerate(self.pattern):
            for j, k in enumerate(indices):
                sums[k].append(f"F[{axis}][{j}] * e[{axis}]")
        return _written_out("F, e", sums)

    def turned(self, F: Regressors, psi: Number) -> tuple[Triple, ...]:
        """F^T R^T(psi), one row for each parameter: its force in the earth-fixed frame."""
        c, s = cos(psi), sin(psi)
        columns = [self.project(F, x) for x in ((c, -s, 0.0), (s, c, 0.0), (0.0, 0.0, 1.0))]
        return tuple(zip(*columns, strict=True))

    def error(self, nu: Triple, nu_dot: Triple, tau: Triple, controller_model: B) -> Triple:
        """y = M nu_dot - known - tau [N, N, N m], (2.36): what F phi + R^T omega_n has to explain."""
        MX, MY, MN = inertia_force(*nu_dot, controller_model.inertia)
        X, Y, N = self.known(*nu, controller_model)
        return MX - X - tau[0], MY - Y - tau[1], MN - N - tau[2]

    def losses(self, phi: Sequence[Number]) -> Triple | None:
        """The limited thruster losses, tau_act = (1 - delta) tau, (7.6); None where not learned."""
        if self.loss is None:
            return None
        a, b, c = (clip(phi[k], *LOSS) for k in self.loss)
        return a, b, c

    def without_loss(self, phi: Sequence[Number]) -> Sequence[Number]:
        """The parameters with thruster losses of zero."""
        lost = self.loss or ()
        return [0.0 if k in lost else x for k, x in enumerate(phi)] if lost else phi

    def matrices(self, grams: Sequence[Sequence[Sequence[Number]]]) -> list[list[list[Number]]]:
        """The information matrix (F^T F summed up) of each block, from that of each axis."""
        found = []
        for axes in self.blocks:
            members = sorted({k for axis in axes for k in self.pattern[axis]})
            place = {k: position for position, k in enumerate(members)}
            matrix: list[list[Number]] = [[0.0] * len(members) for _ in members]
            for axis in axes:
                for i, row in zip(self.pattern[axis], grams[axis], strict=True):
                    for j, x in zip(self.pattern[axis], row, strict=True):
                        matrix[place[i]][place[j]] = matrix[place[i]][place[j]] + x
            found.append(matrix)
        return found
