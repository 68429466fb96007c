"""The columns of a scenario's log by the roles of its instances."""

from types import SimpleNamespace

from diagnosis.predictors import ship_with
from diagnosis.runs.columns import columns
from diagnosis.runs.columns.columns import layout_of


def test_pose_force_commands_and_wind_are_those_of_the_instances(monkeypatch, tmp_path):
    named = {
        "pose": ("sea.x", "sea.y", "sea.psi"),
        "force": ("drive.tau_X", "drive.tau_Y", "drive.tau_N"),
    }
    roles = SimpleNamespace(
        pose=named["pose"], force=named["force"], of=lambda *k: [*named["pose"], *named["force"]]
    )
    monkeypatch.setattr(columns, "read_options", lambda _: SimpleNamespace(roles=roles))
    tanker = ship_with((), "kvlcc2")
    own = ["drive.propeller_n", "drive.rudder_delta", "sea.wind_speed", "sea.wind_direction"]
    names = ["time", *named["pose"], *named["force"], *own, "other.wind_speed"]
    layout = layout_of(names, {}, "the log", tanker, tmp_path)
    found = {signal: column.name for signal, column in layout.columns.items()}
    assert found == dict(zip(("x", "y", "psi"), named["pose"], strict=True)) | dict(
        zip(("tau_X", "tau_Y", "tau_N"), named["force"], strict=True)
    ) | dict(zip(("propeller.n", "rudder.delta", "wind_speed", "wind_direction"), own, strict=True))
