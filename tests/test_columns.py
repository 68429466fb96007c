"""What the columns of foreign logs are: proposed where they are known, blank where not, for one log or a folder."""

import json
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from support.command import command

from cosim import InputError
from diagnosis import propose_columns
from diagnosis.predictors import ship_with
from diagnosis.runs import FOLDER_FILE, propose, read
from diagnosis.runs.columns.columns import quantities
from diagnosis.runs.columns.likely_columns import meaning_of_words

TANKER = ship_with((), "kvlcc2")
NAMES = {
    "time": "t [s]",
    "x": "x_position_mid [m]",
    "y": "y_position_mid [m]",
    "psi": "psi_hat [rad]",
    "propeller.n": "n_prop [rps]",
    "rudder.delta": "delta_rudder [rad]",
}


def zigzag(seconds: float = 120.0, **columns: str) -> pd.DataFrame:
    """A tanker that is steered to and fro, and speeds up, by names of columns."""
    t = np.arange(0.0, seconds, 0.1)
    rudder = 0.3 * np.sign(np.sin(2.0 * np.pi * t / 40.0))
    rate = 0.03 * np.sin(2.0 * np.pi * (t - 5.0) / 40.0)
    shaft = 8.0 + 4.0 * np.sign(np.sin(2.0 * np.pi * t / 90.0))
    speed = 0.8 + 0.3 * np.sin(2.0 * np.pi * (t - 10.0) / 90.0)
    psi = 0.1 * np.cumsum(rate)
    table = {
        "time": t,
        "x": 0.1 * np.cumsum(speed * np.cos(psi)),
        "y": 0.1 * np.cumsum(speed * np.sin(psi)),
        "psi": psi,
        "propeller.n": shaft,
        "rudder.delta": rudder,
    }
    noise = np.random.default_rng(4).normal(0.0, 1e-3, (3, t.size))
    table = {
        s: v + dict(zip(("x", "y", "psi"), noise, strict=True)).get(s, 0.0) for s, v in table.items()
    }
    return pd.DataFrame(table).rename(columns=NAMES | columns)


def written(path: Path, table: pd.DataFrame) -> Path:
    table.to_csv(path, index=False)
    return path


@pytest.mark.parametrize(
    ("name", "unit", "signal"),
    [
        ("x_position_mid", "m", "x"),
        ("x_position_mid", "m/s", ""),
        ("psi_hat", "rad", "psi"),
        ("psi_ref", "rad", ""),
        ("r_angvelo", "rad/s", "r"),
        ("u_velo", "m/s", "u"),
        ("vm_velo", "m/s", "v"),
        ("yawRate", "deg/s", "r"),
        ("n_prop", "rps", "propeller.n"),
        ("propeller speed", "rpm", "propeller.n"),
        ("n_prop_2", "rps", ""),
        ("n_bow", "rps", ""),
        ("delta_rudder", "rad", "rudder.delta"),
        ("rudder angle", "°", "rudder.delta"),
        ("rudder rate", "deg/s", ""),
        ("wind_velo_true", "m/s", "wind_speed"),
        ("wind_dir_true", "rad", "wind_direction"),
        ("wind_velo_relative_mid", "m/s", ""),
        ("x_position_mid", "", ""),
    ],
)
def test_words_of_a_name_and_its_unit_tell_a_signal(name: str, unit: str, signal: str) -> None:
    assert meaning_of_words(name, unit, quantities(TANKER)) == signal


def test_what_is_known_is_proposed_and_read(tmp_path: Path) -> None:
    found = propose(written(tmp_path / "a.csv", zigzag()), TANKER)
    assert found.needed == {"columns": NAMES}
    assert found.run is not None
    np.testing.assert_allclose(
        found.run.commands, zigzag()[[NAMES["propeller.n"], NAMES["rudder.delta"]]]
    )


def test_of_two_columns_of_one_meaning_none_is_chosen_and_both_are_likely(tmp_path: Path) -> None:
    table = zigzag()
    table["delta_rudder_cmd [rad]"] = table["delta_rudder [rad]"]
    found = propose(written(tmp_path / "a.csv", table), TANKER)
    assert found.needed["columns"]["rudder.delta"] == ""
    likely = {c.name for c in found.likely["rudder.delta"]}
    assert likely == {"delta_rudder [rad]", "delta_rudder_cmd [rad]"}


def test_blanks_have_likely_columns_by_the_motion(tmp_path: Path) -> None:
    table = zigzag(**{"propeller.n": "channel 4", "rudder.delta": "channel 7"})
    table["channel 5"] = np.random.default_rng(1).normal(size=len(table))
    table["channel 6"] = 1.0
    path = written(tmp_path / "a.csv", table)
    done = command(propose_columns.main, path, "--ship", "kvlcc2", "--write")
    assert (done.returncode, done.stderr) == (0, "")
    told = " ".join(done.stdout.split())
    assert "blank: propeller.n; likely columns: 'channel 4' (correlates +0." in told
    assert "with the surge speed)" in told
    assert "blank: rudder.delta; likely columns: 'channel 7' (correlates +0." in told
    assert "'channel 5' (" not in told
    assert "'channel 6' (" not in told
    blank = json.loads((tmp_path / "a.csv.json").read_text())
    assert blank["columns"]["rudder.delta"] == blank["columns"]["propeller.n"] == ""
    with pytest.raises(InputError, match=r"a\.csv\.json': columns\.propeller\.n is blank; put the name"):
        read(path, of=TANKER)
    blank["columns"] |= {"rudder.delta": "channel 7", "propeller.n": "channel 4"}
    (tmp_path / "a.csv.json").write_text(json.dumps(blank))
    np.testing.assert_allclose(read(path, of=TANKER).commands, table[["channel 4", "channel 7"]])


def test_a_heading_in_degrees_is_likely_by_the_course(tmp_path: Path) -> None:
    table = zigzag(psi="a")
    table["a"] = np.degrees(table["a"])
    found = propose(written(tmp_path / "a.csv", table), TANKER)
    assert found.likely["psi"][0].name == "a"
    assert found.likely["psi"][0].reasons == ["correlates +1.00 with the course"]


def test_what_is_stated_is_kept(tmp_path: Path) -> None:
    path = written(tmp_path / "a.csv", zigzag(psi="my heading", **{"rudder.delta": "channel 7"}))
    stated = {"trial": "zigzag", "columns": {"psi": {"name": "my heading", "noise": 0.002}}}
    (tmp_path / "a.csv.json").write_text(json.dumps(stated))
    done = command(propose_columns.main, path, "--ship", "kvlcc2", "--write", "--overwrite")
    assert done.returncode == 0
    told = json.loads((tmp_path / "a.csv.json").read_text())
    assert told["columns"]["psi"] == stated["columns"]["psi"]
    assert told["trial"] == "zigzag"
    assert told["columns"]["rudder.delta"] == ""
    assert told["columns"]["x"] == NAMES["x"]


def test_a_blank_that_is_there_is_filled_where_it_is_known(tmp_path: Path) -> None:
    path = written(tmp_path / "a.csv", zigzag())
    (tmp_path / "a.csv.json").write_text('{"columns": {"rudder.delta": "", "x": "x_position_mid [m]"}}')
    assert propose(path, TANKER).needed == {"columns": NAMES}


def test_one_file_holds_for_all_of_a_folder(tmp_path: Path) -> None:
    for k, name in enumerate("abc"):
        written(tmp_path / f"{name}.csv", zigzag(100.0 + 20.0 * k))
    (tmp_path / "README.md").write_text("# Runs\n")
    files = sorted(tmp_path.iterdir())
    done = command(propose_columns.main, *files, "--ship", "kvlcc2", "--write", "--anyway")
    assert (done.returncode, done.stderr) == (0, "")
    assert sorted(p.name for p in tmp_path.iterdir()) == sorted([*(p.name for p in files), FOLDER_FILE])
    assert json.loads((tmp_path / FOLDER_FILE).read_text()) == {"columns": NAMES}
    assert "not tables: README.md" in done.stdout
    rows = [
        line.split() for line in done.stdout.splitlines() if line.startswith(("a.csv", "b.csv", "c.csv"))
    ]
    assert [row[:2] for row in rows] == [["a.csv", "99.9"], ["b.csv", "119.9"], ["c.csv", "139.9"]]
    assert [int(row[5]) for row in rows] == [1000, 1200, 1400]
    channels = done.stdout[done.stdout.index("Channels") :]
    assert all(f"\n  {name} " in channels for name in ("x", "y", "psi"))
    for name in "abc":
        assert read(tmp_path / f"{name}.csv", of=TANKER).signals == ("propeller.n", "rudder.delta")
    again = command(propose_columns.main, *files, "--ship", "kvlcc2", "--write", "--anyway")
    assert (again.returncode, "columns.json' exists" in again.stderr) == (2, True)


def test_the_file_beside_a_measurement_goes_over_that_of_its_folder(tmp_path: Path) -> None:
    path = written(tmp_path / "a.csv", zigzag())
    (tmp_path / FOLDER_FILE).write_text(
        json.dumps({"columns": NAMES | {"y": "t [s]"}, "trial": "zigzag"})
    )
    (tmp_path / "a.csv.json").write_text(
        json.dumps({"columns": {"y": {"name": NAMES["y"], "noise": 0.01}}})
    )
    found = read(path, of=TANKER)
    assert (found.trial, found.noise) == ("zigzag", {"y": 0.01})
    np.testing.assert_allclose(found.pose[:, 1], zigzag()[NAMES["y"]])


def test_what_only_one_has_stands_beside_it(tmp_path: Path) -> None:
    written(tmp_path / "a.csv", zigzag())
    other = zigzag()
    other["r_angvelo [rad/s]"] = np.gradient(other["psi_hat [rad]"], 0.1)
    written(tmp_path / "b.csv", other)
    done = command(
        propose_columns.main,
        tmp_path / "a.csv",
        tmp_path / "b.csv",
        "--ship",
        "kvlcc2",
        "--write",
        "--anyway",
    )
    assert json.loads((tmp_path / FOLDER_FILE).read_text()) == {"columns": NAMES}
    told = " ".join(done.stdout.split())
    assert "b.csv' also needs" in told
    assert '{"columns": {"r": "r_angvelo [rad/s]"}}' in told


def test_a_unit_that_one_shows_is_that_of_all(tmp_path: Path) -> None:
    one, other = zigzag(psi="heading"), zigzag(psi="heading")
    one["heading"] = np.degrees(one["heading"] * 4.0) % 360.0
    other["heading"] = np.degrees(other["heading"])
    files = written(tmp_path / "a.csv", one), written(tmp_path / "b.csv", other)
    assert "unit" not in propose(files[1], TANKER).needed["columns"]["psi"]
    command(propose_columns.main, *files, "--ship", "kvlcc2", "--write", "--anyway")
    told = json.loads((tmp_path / FOLDER_FILE).read_text())["columns"]["psi"]
    assert told == {"name": "heading", "unit": "deg"}


def test_folders_and_texts_that_differ_are_refused(tmp_path: Path) -> None:
    (tmp_path / "other").mkdir()
    files = written(tmp_path / "a.csv", zigzag()), written(tmp_path / "other" / "b.csv", zigzag())
    assert (
        "these files are in several" in command(propose_columns.main, *files, "--ship", "kvlcc2").stderr
    )
    (tmp_path / "b.csv").write_text(zigzag().to_csv(index=False, sep=";"))
    done = command(propose_columns.main, files[0], tmp_path / "b.csv", "--ship", "kvlcc2", "--write")
    assert done.returncode == 2
    assert "b.csv' differs from that of" in done.stderr
    assert not (tmp_path / FOLDER_FILE).exists()
