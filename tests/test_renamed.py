"""Names that users type: the old ones are read for one version, with one warning, and mean the same."""

import argparse
import json
import re
import warnings
from pathlib import Path

import pytest
from support.command import command
from support.project import ROOT

import cosim.run
from cosim import InputError
from cybership.renamed import KEYS, OPTIONS, VALUES, OldNameWarning, renamed_keyword, with_new_names
from diagnosis import linearise, propose_columns
from diagnosis.acceptance.criterion import read_criteria
from diagnosis.fmu_parameters.system_map import read_system_map
from diagnosis.predictors.fmu.variable_map import read_map
from fmus.build.__main__ import main
from fmus.ships.ship_file import find_ship, read_ship, shipped_ships

PLACES = [(kind, place) for kind, renamed in KEYS.items() for place in renamed]
NEW_TO_OLD = {new: place.rpartition(".")[2] for place, new in KEYS["ship"].items()}
UNTIL = "the old name is read until version 2"
TUG = """
name = "tug"
title = "the tug"
length = 2.0
beam = 1.0
thrust_allocation = false

[inertia]
m = { value = 50.0, rel_std = 0.1 }
I_z = 20.0

[hull]
terms = [{ axis = "X", product = "u", value = -10.0, rel_std = 0.2 }]

[hull.functions.cross_flow]
cross_flow_length = { value = 2.0, rel_std = 0.0 }
cross_flow_draft = { value = 0.1, rel_std = 0.0 }

[wind]
frontal_area = { value = 0.5, rel_std = 0.3 }
lateral_area = 1.0

[[actuators]]
name = "port"
law = "force_table_surge"
command_group = "both"
y = { value = -0.3, rel_std = 0.05 }

[[actuators]]
name = "starboard"
law = "force_table_surge"
command_group = "both"
y = 0.3

[[actuators]]
name = "stern"
law = "force_table_sway"
x = -0.8
"""
FORCES = "\n".join(f"F_{k} = {k - 6}.0" for k in range(1, 12))
TUG = re.sub('"(force_table_.*)"', rf'"\1"\n{FORCES}', TUG)
MAP = {"outputs": {"x": "north"}, "disturbance_inputs": {"tau_X": "pull"}}
SYSTEM_MAP = {"outputs": {"x": "north"}, "disturbance_inputs": ["pull"]}
CRITERIA = {
    "criteria": [
        {"quantity": "r", "horizon": 1, "tolerance": 2.0, "unit": "deg/s", "statistic": "fraction",
         "operating_range": {"u": [1.0, 3.0]}},
        {"quantity": "position", "horizon": 1.0, "tolerance": 2.0, "unit": "m"},
    ]
}  # fmt: skip


def of_place(place, value):
    """The smallest content of a file with a value at a place."""
    for key in reversed(place.split(".")):
        value = [value] if key == "*" else {key: value}
    return value


def read(reader, path, text):
    """What a file holds, and its warnings."""
    path.write_text(text, encoding="utf-8")
    with warnings.catch_warnings(record=True) as found:
        warnings.simplefilter("always")
        content = reader(path)
    assert all(w.category is OldNameWarning for w in found)
    return content, [str(w.message) for w in found]


def aged(text):
    """A ship's file as it was written before."""
    for new, old in NEW_TO_OLD.items():
        text = re.sub(rf"\b{new}(?= =)", old, text)
    for old, new in VALUES["ship"]["actuators.*.law"].items():
        text = text.replace(f'"{new}"', f'"{old}"')
    return text


@pytest.mark.parametrize(("kind", "place"), PLACES)
def test_an_old_key_is_read_with_a_warning_and_not_beside_the_new_one(kind, place):
    old, new = place.rpartition(".")[2], KEYS[kind][place]
    outer = place.removesuffix(old).rstrip(".")
    nested = [key if key != "*" else "some" for key in outer.split(".")] if outer else []

    def content(table):
        for key in reversed(nested):
            table = {key: table}
        return table

    with pytest.warns(OldNameWarning, match=re.escape(f"'{old}' is now '{new}'; {UNTIL}")):
        found = with_new_names(content({"a": 0, old: 1, "b": 2}), kind, f"{kind} {place}")
    assert found == content({"a": 0, new: 1, "b": 2})
    assert list(_inner(found, nested)) == ["a", new, "b"]  # parameters keep their order
    with pytest.raises(ValueError, match=rf"'{old}' is the old name of '{new}'; keep '{new}' alone"):
        with_new_names(content({old: 1, new: 1}), kind, "both")


def _inner(content, keys):
    for key in keys:
        content = content[key]
    return content


@pytest.mark.parametrize(
    ("kind", "place", "old"),
    [
        (kind, place, old)
        for kind, all_ in VALUES.items()
        for place, names in all_.items()
        for old in names
    ],
)
def test_an_old_value_is_read_with_a_warning(kind, place, old):
    new = VALUES[kind][place][old]
    with pytest.warns(OldNameWarning, match=re.escape(f"'{old}' is now '{new}'; {UNTIL}")):
        found = with_new_names(of_place(place, old), kind, f"{kind} {old}")
    assert found == of_place(place, new)


@pytest.mark.parametrize("name", shipped_ships())
def test_a_shipped_ship_under_the_old_names_is_the_same(name, tmp_path):
    text = find_ship(name).read_text(encoding="utf-8")
    old, stated = read(read_ship, tmp_path / f"{name}.toml", aged(text))
    assert old == read_ship(name)
    assert len(stated) == 1
    assert stated[0].startswith(f"'{tmp_path / f'{name}.toml'}': '")
    assert "'share' is now 'rel_std'" in stated[0]


def test_every_old_name_of_a_ship_gives_the_same_description(tmp_path):
    new, none = read(read_ship, tmp_path / "new.toml", TUG)
    old, stated = read(read_ship, tmp_path / "old.toml", aged(TUG))
    assert none == []
    assert old == new
    assert len(stated) == 1
    assert stated[0].endswith("; the old names are read until version 2")
    for name in ("share", "order", "allocates", "force_table_ahead", "force_table_aside"):
        assert f"'{name}' is now" in stated[0]


@pytest.mark.parametrize(
    ("reader", "content", "renamed"),
    [
        (read_map, MAP, [("disturbance_inputs", "beside")]),
        (read_system_map, SYSTEM_MAP, [("disturbance_inputs", "beside")]),
        (
            lambda path: read_criteria(path).content,
            CRITERIA,
            [("operating_range", "within"), ("fraction", "share")],
        ),
    ],
)
def test_maps_and_criteria_under_the_old_names_are_the_same(reader, content, renamed, tmp_path):
    text = aged_text = json.dumps(content)
    for new, old in renamed:
        aged_text = aged_text.replace(f'"{new}"', f'"{old}"')
    new, none = read(reader, tmp_path / "new.json", text)
    old, stated = read(reader, tmp_path / "old.json", aged_text)
    assert none == []
    assert old == new
    assert len(stated) == 1
    again, silent = read(reader, tmp_path / "old.json", aged_text)
    assert again == old
    assert silent == []  # one warning a file


@pytest.mark.parametrize(
    ("reader", "text"),
    [
        (read_map, '{"beside": {}, "disturbance_inputs": {}}'),
        (read_system_map, '{"beside": [], "disturbance_inputs": []}'),
        (read_criteria, '{"criteria": [{"within": {}, "operating_range": {}}]}'),
    ],
)
def test_both_names_in_one_table_are_refused(reader, text, tmp_path):
    with pytest.raises(InputError, match=r"both\.json'.*is the old name of '\w+'; keep '\w+' alone"):
        read(reader, tmp_path / "both.json", text)


# What is changed in the file of a ship -> what the message says.
WRONG = [
    ("rel_std = 0.1", "rel_std = 0.1, share = 0.1", "inertia.m: 'share' is the old name of 'rel_std'"),
    ("y = 0.3", 'y = 0.3\norder = "both"', "actuators[1]: 'order' is the old name of 'command_group'"),
    ("rel_std = 0.1", "rel_sdt = 0.1", "inertia.m.rel_sdt: unknown key; did you mean 'rel_std'?"),
    ("thrust_allocation", "thrust_alocation", "unknown key; did you mean 'thrust_allocation'?"),
    ('command_group = "both"', 'comand_group = "both"', "did you mean 'command_group'?"),
    ("y = 0.3", 'upstream_propeler = "port"', "did you mean 'upstream_propeller'?"),
    ("y = 0.3", "half_spacng = 0.1", "unknown key 'half_spacng'; did you mean 'half_spacing'?"),
    ("force_table_sway", "force_table_swai", "did you mean 'force_table_sway'?"),
]


@pytest.mark.parametrize(("old", "new", "says"), WRONG)
def test_one_line_names_the_new_key(old, new, says, tmp_path):
    assert old in TUG
    (tmp_path / "tug.toml").write_text(TUG.replace(old, new, 1))
    done = command(main, "--list", "vessel", "--ship", tmp_path / "tug.toml")
    assert done.returncode == 2
    assert says in done.stderr
    assert done.stderr.count("\n") == 1


def test_a_command_shows_one_warning_for_a_file(tmp_path):
    path = tmp_path / "tug.toml"
    path.write_text(aged(TUG))
    done = command(main, "--list", "vessel", "--ship", path)
    assert done.returncode == 0
    assert done.stderr.count("\n") == done.stderr.count("is now 'rel_std'") == 1
    other = tmp_path / "other.toml"
    other.write_text(aged(TUG))
    done = command(propose_columns.main, tmp_path / "none.csv", "--ship", other)
    assert done.stderr.count("warning: ") == done.stderr.count("is now 'rel_std'") == 1


PARSERS = {
    "--controller-model": (cosim.run._parser, "ellipse"),
    "--operating-point": (linearise._parser, "vendor.fmu"),
}


@pytest.mark.parametrize("new", OPTIONS)
def test_an_option_is_read_under_its_old_name(new, capsys):
    parser, positional = PARSERS[new]
    old = OPTIONS[new]
    wanted = parser().parse_args([positional, new, "a"])
    assert capsys.readouterr().err == ""
    assert parser().parse_args([positional, old, "a"]) == wanted
    assert capsys.readouterr().err == f"warning: '{old}' is now '{new}'; {UNTIL}\n"
    with pytest.raises(SystemExit) as ended:
        parser().parse_args([positional, old, "a", new, "b"])
    assert ended.value.code == 2
    assert "not allowed with" in capsys.readouterr().err
    shown = parser().format_help()
    assert new in shown
    assert not re.search(rf"{old}\b", shown)


def test_an_option_that_is_repeated_warns_once(capsys):
    parser = cosim.run._parser()
    assert isinstance(parser, argparse.ArgumentParser)
    given = parser.parse_args(["ellipse", "--believe", "a.ssv", "--believe", "b.ssv"])
    assert given.controller_model == ["a.ssv", "b.ssv"]
    assert capsys.readouterr().err.count("warning: ") == 1


def test_a_keyword_is_taken_under_its_old_name():
    @renamed_keyword("believe", "controller_model")
    def simulated(x, controller_model=()):
        return x, controller_model

    with pytest.warns(DeprecationWarning, match="'believe' is now 'controller_model'"):
        assert simulated(1, believe="a") == (1, "a")
    with pytest.raises(TypeError, match="'controller_model' and its old name 'believe'"):
        simulated(1, believe="a", controller_model="b")


def test_the_changelog_has_the_whole_table():
    text = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
    shown = set(re.findall(r"^ *\| [\w ,]+ \| `([\w-]+)` \| `([\w-]+)` \|", text, re.MULTILINE))
    known = {(old, new) for new, old in OPTIONS.items()}
    for places in KEYS.values():
        known |= {(place.rpartition(".")[2], new) for place, new in places.items()}
    for places in VALUES.values():
        known |= {pair for names in places.values() for pair in names.items()}
    assert shown == known


def test_no_shipped_file_has_an_old_name():
    for folder, pattern in (("ships", "*.toml"), ("examples", "**/*.toml")):
        for path in Path(ROOT, folder).glob(pattern):
            keys = set(re.findall(r"\b(\w+) =", path.read_text(encoding="utf-8")))
            assert not keys & set(NEW_TO_OLD.values()), path
