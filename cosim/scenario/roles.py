"""Roles of columns: which signals metrics and pictures take for the pose, the target, the force, ..."""

from collections.abc import Iterator

from pydantic import ConfigDict, Field

from .json_files import StrictModel

# Surge, sway and yaw components; or north, east and heading.
Columns = tuple[str, str, str]


def _axes(prefix: str) -> Columns:
    """The surge, sway and yaw columns of a force."""
    return f"{prefix}X", f"{prefix}Y", f"{prefix}N"


class Roles(StrictModel):
    """Columns by role, three names ``instance.variable`` each; shipped scenarios use the defaults."""

    model_config = ConfigDict(frozen=True)

    pose: Columns = Field(
        default=("vessel.x", "vessel.y", "vessel.psi"),
        description="true north, east [m] and heading [rad]",
    )
    velocity: Columns = Field(
        default=("vessel.u", "vessel.v", "vessel.r"),
        description="surge, sway [m/s] and yaw rate [rad/s]",
    )
    target: Columns = Field(
        default=("guidance.x_t", "guidance.y_t", "guidance.psi_t"),
        description="target: north, east [m] and heading [rad]",
    )
    force: Columns = Field(
        default=_axes("thrusters.tau_cmd_"),
        description="commanded force after limits: surge, sway [N], yaw [N.m]",
    )
    requested_force: Columns = Field(
        default=_axes("controller.tau_"),
        description="force that the controller requests; used for 'force' if that is missing",
    )
    linear_force: Columns = Field(
        default=_axes("controller.tau_lin_"), description="linear part of the requested force"
    )
    nonlinear_force: Columns = Field(
        default=_axes("controller.tau_nonlin_"), description="nonlinear part of the requested force"
    )
    acting_force: Columns = Field(
        default=_axes("thrusters.tau_act_"),
        description="acting force; its difference to 'force' is a model error",
    )
    model_error: Columns = Field(
        default=_axes("vessel.omega_star_"), description="true model error of the hull"
    )
    estimate: Columns = Field(
        default=_axes("controller.omega_hat_"), description="estimated model error"
    )

    power: tuple[str, ...] = Field(
        default=(), description="power [W] of each actuator, such as thrusters.NAME_power"
    )

    def of(self, *roles: str) -> tuple[str, ...]:
        """The columns of some roles, one after the other."""
        return tuple(column for role in roles for column in getattr(self, role))

    @property
    def metric_inputs(self) -> tuple[str, ...]:
        """All columns that metrics may read."""
        return self.of("pose", "velocity", "target", "force", "requested_force", "power")

    @property
    def columns(self) -> tuple[str, ...]:
        """``time`` and all columns that metrics and pictures may read."""
        tracking = self.of("pose", "velocity", "target", "requested_force", "force", "power")
        forces = self.of("linear_force", "nonlinear_force", "acting_force", "model_error", "estimate")
        return ("time", *tracking, *forces)

    def given(self) -> Iterator[tuple[str, str]]:
        """Role and column of each role that was stated, as opposed to its default."""
        for role in type(self).model_fields:
            if role in self.model_fields_set:
                for column in self.of(role):
                    yield role, column


DEFAULT_ROLES = Roles()
