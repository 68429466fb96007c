"""Guidance along an ellipse at constant or pulsing speed, (4.39)-(4.40); no inputs."""

from typing import Annotated, NamedTuple

from ..declare import Range, component
from ..ops import Number, cos, sin, sqrt
from ..signals import Nothing, Target
from .pace import PathTiming, PulseClock, tick
from .path import Course, PathPoint, target


class Params(NamedTuple):
    u_t: Annotated[float, "m/s", "speed along the path", Range(-2.0, 2.0)] = 0.08
    a_x: Annotated[float, "m", "semi-axis to the north", Range(min=0.01)] = 1.0
    a_y: Annotated[float, "m", "semi-axis to the east", Range(min=0.01)] = 1.5
    course: Course = Course()
    pace: PathTiming = PathTiming()


class State(NamedTuple):
    theta: float = 0.0
    clock: PulseClock = PulseClock()


def rates(theta: Number, p: Params) -> tuple[Number, Number]:
    """theta_dot [rad/s] for a constant speed along the path, (4.40), and its derivative."""
    s = sin(theta)
    c = cos(theta)
    square = p.a_x * p.a_x * c * c + p.a_y * p.a_y * s * s
    theta_dot = p.u_t / sqrt(square)
    return theta_dot, -theta_dot * theta_dot * (p.a_y * p.a_y - p.a_x * p.a_x) * s * c / square


def init(i: Nothing, p: Params) -> State:
    return State(p.course.theta_0)


def step(s: State, i: Nothing, p: Params, h: Number) -> tuple[State, Target]:
    clock, beat = tick(s.clock, p.pace, h)
    half, _ = rates(s.theta, p)
    middle, _ = rates(s.theta + 0.5 * beat.passed * half, p)
    theta = s.theta + beat.passed * middle
    theta_dot, theta_ddot = rates(theta, p)
    n, e = sin(theta), cos(theta)
    point = PathPoint(
        p.course.x_c + p.a_x * n,
        p.course.y_c + p.a_y * e,
        p.a_x * e,
        -p.a_y * n,
        -p.a_x * n,
        -p.a_y * e,
        -p.a_x * e,
        p.a_y * n,
    )
    return State(theta, clock), target(point, *beat.rates(theta_dot, theta_ddot))


COMPONENT = component(
    name="guidance_ellipse",
    description="Guidance along an ellipse at constant speed",
    init=init,
    step=step,
)
