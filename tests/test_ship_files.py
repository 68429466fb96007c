"""Files that describe ships: what is wrong with one is told in one line, and never ends in a traceback."""

import json
import re
import warnings
from contextlib import suppress
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from support.command import command
from support.fmu_variables import page as variables_page
from support.project import ROOT

from diagnosis import propose_columns
from fmus.actuators.law import Law
from fmus.build import build
from fmus.build.__main__ import main
from fmus.declare import DeclarationError, parameters_of, variables
from fmus.effects.text import Found
from fmus.hull_functions import FUNCTIONS
from fmus.ship import ship
from fmus.ships import ship_file
from fmus.ships.__main__ import main as schema_main
from fmus.ships.ship_file import Term, find_ship, read_ship, shipped_ships
from fmus.ships.ship_warning import ShipWarning

RIGHT = """
name = "raft"
title = "the raft"
length = 2.0
beam = 1.0

[inertia]
m = { value = 50.0, origin = "weighed", std = 0.5 }
I_z = 20.0
X_udot = -5.0

[hull]
terms = [{ axis = "X", product = "u", value = -10.0, rel_std = 0.2 }]

[hull.functions.cross_flow]
cross_flow_length = 2.0
cross_flow_draft = 0.1
[[actuators]]
name = "port"
law = "fixed_propeller"
y = -0.4
n_max = 10.0
n_min = -10.0
k_ahead = 2.0
k_astern = 2.0

[[actuators]]
name = "starboard"
law = "fixed_propeller"
y = 0.4
n_max = 10.0
n_min = -10.0
k_ahead = 2.0
k_astern = 2.0
"""


def written(folder: Path, text: str | bytes) -> Path:
    path = folder / "raft.toml"
    path.write_bytes(text.encode() if isinstance(text, str) else text)
    return path


def test_the_right_file_is_read(tmp_path: Path) -> None:
    raft = read_ship(written(tmp_path, RIGHT))
    assert [a.name for a in raft.actuators] == ["port", "starboard"]
    m, I_z, _ = raft.inertia
    assert (m.origin, m.share, m.std) == ("weighed", 0.01, 0.5)
    assert (I_z.origin, I_z.share) == ("guessed", 0.5)
    assert ship(description=raft).vessel.params().inertia.Y_vdot == 0.0  # not that of another ship


# What is changed in the file -> what the message says, the right key among it.
CHANGES = [
    ("beam = 1.0", "baem = 1.0", "baem: unknown key; did you mean 'beam'?"),
    ("length = 2.0", "", "length: is missing"),
    ("length = 2.0", "lenght = 2.0", "lenght: unknown key; did you mean 'length'?"),
    ("length = 2.0", "length = 0.0", "length: Input should be greater than"),
    ("length = 2.0", "length = nan", "length: "),
    ("length = 2.0", "length = inf", "length: "),
    ("length = 2.0", 'length = "2 m"', "length: Input should be a valid number"),
    ("beam = 1.0", "beam = true", "beam: Input should be a valid number"),
    ('"raft"', '"../raft"', "name: "),
    ("I_z = 20.0", "", "inertia: I_z is missing"),
    ("m = { value = 50.0", "M = { value = 50.0", "inertia: unknown key 'M'; did you mean 'm'?"),
    ("X_udot = -5.0", "X_udto = -5.0", "inertia: unknown key 'X_udto'; did you mean 'X_udot'?"),
    ("value = 50.0", "vlaue = 50.0", "inertia.m.vlaue: unknown key; did you mean 'value'?"),
    ("value = 50.0", "value = -50.0", "inertia: m = -50 kg is out of its range"),
    ("value = 50.0", "value = nan", "inertia.m.value: Input should be a finite number"),
    ("std = 0.5", "std = 0.5, rel_std = 0.1", "inertia.m: a number has std or rel_std, not both"),
    ("std = 0.5", "std = -0.5", "inertia.m.std: Input should be greater than 0"),
    ("X_udot = -5.0", "X_udot = 60.0", "mass matrix of these numbers is not positive definite"),
    ("X_udot = -5.0", "x_g = 2.0", "mass matrix of these numbers is not positive definite"),
    ('product = "u"', 'product = "u^2"', "'u^2' is not a product of u, v, r, |u|, |v| and |r|"),
    ('product = "u"', 'product = "|u"', "'|u' is not a product"),
    ('product = "u"', 'product = ""', "'' is not a product"),
    ('axis = "X"', 'axis = "Z"', "hull.terms[0].axis: Input should be 'X', 'Y' or 'N'; got 'Z'"),
    ('name = "port"', 'name = "Port"', "actuators[0].name: needs small letters, digits and underscores, a letter first; got 'Port'"),
    ('axis = "X"', 'axes = "X"', "hull.terms[0].axes: unknown key; did you mean 'axis'?"),
    ("rel_std = 0.2 }", 'rel_std = 0.2 }, { axis = "X", product = "u", value = 1.0 }', "X_u occurs twice"),
    ("terms =", "termes =", "hull.termes: unknown key; did you mean 'terms'?"),
    ("cross_flow]", "crossflow]", "there is no 'crossflow'; did you mean 'cross_flow'?"),
    ("cross_flow_length", "cross_length", "unknown key 'cross_length'; did you mean 'cross_flow_length'?"),
    ('law = "fixed_propeller"', 'law = "propeler"', "no law 'propeler'; did you mean 'fixed_propeller'?"),
    ('law = "fixed_propeller"', "", "actuators[0].law: is missing"),
    ('name = "starboard"', 'name = "port"', "actuators: port occurs twice"),
    ('name = "port"', 'name = "for"', "actuator 'for': a keyword of Python cannot be a name"),
    ("n_max = 10.0", "n_mx = 10.0", "actuator 'port': unknown key 'n_mx'; did you mean 'n_max'?"),
    ("n_max = 10.0", "n_max = -10.0", "n_max = -10 1/s is out of its range (>= 0)"),
    ("n_min = -10.0", "n_min = 10.0", "n_min = 10 1/s is out of its range"),
    ("n_max = 10.0", "n_max = nan", "actuator 'port': n_max: Input should be a finite number"),
    ("n_max = 10.0", "n_max = [1]", "actuator 'port': n_max: Input should be a valid number"),
    ("n_max = 10.0", "n_max = {vlue = 1.0}", "n_max: vlue: unknown key; did you mean 'value'?"),
    ("n_max = 10.0", "lag = 1e6", "lag = 1e+06 s is out of its range (0 to"),
    ("beam = 1.0", f"beam = {'1' * 5000}", "cannot be read as TOML: Exceeds the limit"),
    (
        "[inertia]", '[aliases]\nport_n = "a"\nstarboard_n = "a"\n[inertia]',
        "aliases: port_n and starboard_n are both 'a'",
    ),
    ("beam = 1.0", 'beam = 1.0\nthrust_allocation = "no"', "thrust_allocation: Input should be a valid"),
    ("beam = 1.0", f"beam = {'1' * 4000}", "beam: Input should be"),
    ('law = "fixed_propeller"', f'law = "{"y " * 50_000}"', "there is no law 'y y y"),
    ('law = "fixed_propeller"', f'law = "{"y" * 100_000}"', f"there is no law '{'y' * 28}...{'y' * 28}'"),
    ("n_max = 10.0", f'"{"é" * 50_000}" = 1.0', "unknown key 'éééé"),
    ("beam = 1.0", 'beam = 1.0\n"be\\u001b[31mam\\n" = 1', "be\\x1b[31mam: unknown key"),
    ('law = "fixed_propeller"', 'law = "\\u0007{0}"', "there is no law '\\x07{0}'"),
    # Names of variables that would be there twice.
    ('name = "port"', 'name = "surge"', "there is an effect 'loss_surge' already"),
    ('name = "port"', 'name = "plant_starboard"', "thrusters declares plant_starboard_"),
    ('name = "port"\nlaw = "fixed_propeller"', 'name = "tau"\nlaw = "given_force"', "tau_X"),
]  # fmt: skip


# What is changed in the file -> line and beginning of the warning.
DOUBTS = [
    ("value = -10.0", "value = 10.0", 13, "X_u = 10 N.s/m adds energy at 0.0044 m/s in surge"),
    (
        "rel_std = 0.2 }]", 'rel_std = 0.2 },\n  { axis = "X", product = "|u|u", value = 1.0 }]', 14,
        "X_absu_u = 1 N.s2/m2 adds energy at 14 m/s in surge",
    ),
    (
        "rel_std = 0.2 }]", 'rel_std = 0.2 },\n  { axis = "N", product = "r", value = 1.0 }]', 14,
        "N_r = 1 N.m.s/rad adds energy at 0.0022 rad/s in yaw",
    ),
    (
        "rel_std = 0.2 }]", 'rel_std = 0.2 }, { axis = "Y", product = "vvv", value = 1.0 }]', 13,
        "Y_vvv = 1 N.s3/m3 adds energy at 0.0044 m/s in sway",
    ),
    (
        "rel_std = 0.2 }]", 'rel_std = 0.2 }]\n[hull.functions.resistance]\ndrag_area = 1.0\ndrag_ahead = -0.1', 14,
        "resistance adds energy at 0.89 m/s in surge",
    ),
    (
        "cross_flow_draft = 0.1", "", 15,
        "cross_flow does not state all of its numbers; assumed: cross_flow_draft = 0.1 m",
    ),
    ("X_udot = -5.0", "X_udot = 5.0", 10, "X_udot = 5 kg is positive"),
    ("X_udot = -5.0", "Y_vdot = 5.0", 10, "Y_vdot = 5 kg is positive"),
    ("X_udot = -5.0", "N_rdot = 0.5", 10, "N_rdot = 0.5 kg.m2 is positive"),
    ("y = -0.4", "y = -40.0", 21, "actuator 'port' is at y = -40 m, outside of the outline, -0.5 to 0.5 m"),
    ("y = 0.4", "y = 0.4\nx = -1.2", 31, "actuator 'starboard' is at x = -1.2 m, outside of the outline"),
    (
        "k_ahead = 2.0\n", "", 18,
        "actuator 'port' does not state all of its numbers; assumed: k_ahead = 1 N.s2",
    ),
    (
        "[hull]", "[wind]\nlateral_area = 2.0\n[hull]", 12,
        "wind does not state all of its numbers; assumed: frontal_area = 1 m2",
    ),
    ("value = 50.0", "value = 210.0", 8, "m = 210 kg is more than a box of length x beam x draft, 2 m x 1 m x 0.1 m"),
    ("value = 50.0", "value = 0.05", 8, "m = 0.05 kg; ships of 2 m x 1 m have 3.5 to 2e+03 kg"),
    ("beam = 1.0", "beam = 2.1", 4, "beam = 2.1 m is more than the length, 2 m"),
    ("I_z = 20.0", "I_z = 2e4", 9, "I_z = 2e+04 kg.m2 is a radius of gyration of 10 lengths; ships have 0.14 to 0.5"),
    ("I_z = 20.0", "I_z = 0.02", 9, "I_z = 0.02 kg.m2 is a radius of gyration of 0.01 lengths"),
    ("n_max = 10.0", "n_max = 600.0", 22, "actuator 'port' gives 7.2e+05 N, more than the ship's weight, 490 N"),
    (
        'law = "fixed_propeller"\ny = -0.4', 'law = "azimuth"\nalpha_max = 180.0\ny = -0.4', 21,
        "actuator 'port': alpha_max = 180 rad is more than two turns; is it in degrees?",
    ),
    (
        RIGHT[RIGHT.index("[hull]"):RIGHT.index("[[actuators]]")], "", None,
        "the hull has no damping: what moves never stops",
    ),
]  # fmt: skip
# What a ship may have: damping that resists at all speeds with a coefficient of either sign, an outboard motor.
SOUND = [
    ("rel_std = 0.2 }]", """rel_std = 0.2 }, { axis = "X", product = "|u|u", value = 1.0 },
        { axis = "X", product = "uuu", value = -1.0 }]"""),
    ("rel_std = 0.2 }]", 'rel_std = 0.2 }, { axis = "N", product = "v", value = 9.0 }]'),
    ("X_udot = -5.0", "X_udot = -5.0\nY_rdot = 1.0"),
    ("y = -0.4", "y = -0.4\nx = -1.05"),
    ("value = 50.0", "value = 200.0"),
    ("value = 50.0", "value = 45.0"),
    ("beam = 1.0", "beam = 2.0"),
    ("I_z = 20.0", "I_z = 49.0"),
    ("I_z = 20.0", "I_z = 4.0"),
    ("n_max = 10.0", "n_max = 15.6"),
    ('law = "fixed_propeller"\ny = -0.4', 'law = "azimuth"\nalpha_max = 12.5\ny = -0.4'),
]  # fmt: skip


def doubted(folder: Path, old: str, new: str) -> list[str]:
    """Warnings of a changed file."""
    text = RIGHT.replace("[inertia]", "draft = 0.1\n[inertia]", 1).lstrip()
    assert old in text
    with warnings.catch_warnings(record=True) as found:
        warnings.simplefilter("always")
        read_ship(written(folder, text.replace(old, new, 1)))
    assert all(w.category is ShipWarning for w in found)
    return [str(w.message) for w in found]


@pytest.mark.parametrize(("old", "new", "line", "says"), DOUBTS)
def test_a_number_that_no_ship_has_is_a_warning_with_its_line(
    old: str, new: str, line: int | None, says: str, tmp_path: Path
) -> None:
    (text,) = doubted(tmp_path, old, new)
    where = f"'{tmp_path / 'raft.toml'}'" + (f", line {line}" if line else "")
    assert text.startswith(f"{where}: {says}")


@pytest.mark.parametrize(("old", "new"), SOUND)
def test_what_a_ship_may_have_is_no_warning(old: str, new: str, tmp_path: Path) -> None:
    assert doubted(tmp_path, old, new) == []


@pytest.mark.parametrize("name", shipped_ships())
def test_no_shipped_ship_has_a_warning(name: str, tmp_path: Path) -> None:
    (tmp_path / "copy.toml").write_bytes(find_ship(name).read_bytes())
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        read_ship(tmp_path / "copy.toml")


def test_a_file_may_begin_with_a_byte_order_mark(tmp_path: Path) -> None:
    path = written(tmp_path, RIGHT)
    marked = tmp_path / "marked.toml"
    marked.write_bytes(b"\xef\xbb\xbf" + path.read_bytes())
    assert read_ship(marked) == read_ship(path)


def test_a_command_shows_a_warning_once_and_goes_on(tmp_path: Path) -> None:
    (tmp_path / "other").mkdir()
    path = written(tmp_path, RIGHT.replace("X_udot = -5.0", "X_udot = 5.0"))
    done = command(main, "--list", "vessel", "--ship", path)
    assert done.returncode == 0
    assert done.stderr.count("X_udot = 5 kg is positive") == 1
    assert done.stderr.startswith(f"note: '{path}', line 10: ")
    other = written(tmp_path / "other", RIGHT.replace("X_udot = -5.0", "X_udot = 6.0"))
    done = command(propose_columns.main, tmp_path / "none.csv", "--ship", other)
    assert done.stderr.count("warning: ") == done.stderr.count("X_udot = 6 kg is positive") == 1


@pytest.mark.parametrize(("old", "new", "says"), CHANGES)
def test_one_line_says_what_is_wrong(old: str, new: str, says: str, tmp_path: Path) -> None:
    assert old in RIGHT
    text = RIGHT.replace(old, new, 1)
    if "given_force" in new:
        text = text.replace(
            "n_max = 10.0\nn_min = -10.0\nk_ahead = 2.0\nk_astern = 2.0\n", "F_X = 9.0\nF_Y = 9.0\n", 1
        )
    done = command(main, "vessel", "--ship", written(tmp_path, text))
    assert done.returncode == 2
    assert says in done.stderr
    assert done.stderr.count("\n") == 1
    assert len(done.stderr) < 800
    assert done.stderr.isascii() or "é" in new
    assert done.stdout == ""


def test_a_place_further_than_a_metre_away_is_in_metres() -> None:
    effect = ship(description=read_ship("kvlcc2")).effects["marker_offset"]
    found = Found(effect, {"marker_offset_dx": -61.5, "marker_offset_dy": 0.572})
    assert effect.wording is not None
    assert "61.5 m astern and 57.2 cm to starboard" in effect.wording.sentence(found)


def test_no_text_of_a_file_is_a_format(tmp_path: Path) -> None:
    braces = "{0}{title} %s %(a)d ''' \""
    text = RIGHT.replace('title = "the raft"', f"title = {json.dumps(braces)}")
    text = text.replace("y = -0.4", f"y = -0.4\ntitle = {json.dumps(braces)}")
    text = text.replace('origin = "weighed"', f"origin = {json.dumps(braces)}")
    raft = ship(description=read_ship(written(tmp_path, text)))
    for effect in raft.effects.values():
        if effect.wording is not None:
            values = {p.name: 0.5 for p in effect.parameters}
            effect.wording.sentence(Found(effect, values))
    (made,) = build("thrusters", tmp_path, ship=raft.description)
    assert made.is_file()


@pytest.mark.parametrize("place", ['"the raft"', '"weighed"'])
def test_a_text_that_xml_cannot_hold_is_refused(place: str, tmp_path: Path) -> None:
    for escaped, right in (("\\u0007", False), ("\\u007f", False), ("\\t", True), ("é", True)):
        path = written(tmp_path, RIGHT.replace(place, f'"a{escaped}"'))
        if right:
            (made,) = build("vessel", tmp_path / ascii(escaped).strip("'\\"), ship=read_ship(path))
            assert made.is_file()
        else:
            with pytest.raises(DeclarationError, match="has the control character"):
                read_ship(path)


@pytest.mark.parametrize(
    "text",
    [
        "",
        "name",
        "[" * 5000,
        "a = " + "[" * 3000,
        b"\x00\xff\xfe",
        b"\x89PNG\r\n\x1a\n",
        "x = 1\n" * 200_000,
        "[[inertia]]",
        "actuators = 3",
        'actuators = ["port"]',
        "hull = 1",
        "m = 1979-05-27",
    ],
    ids=lambda text: repr(text[:12]),
)
def test_what_is_no_description_is_told_in_one_line(text: str | bytes, tmp_path: Path) -> None:
    done = command(main, "vessel", "--ship", written(tmp_path, text))
    assert done.returncode == 2
    assert re.fullmatch(r"error: .*raft\.toml.*\n", done.stderr)
    assert len(done.stderr) < 400


@pytest.mark.parametrize(
    ("name", "says"),
    [
        ("oter", "no ship 'oter'; did you mean 'otter'?"),
        ("../ships/otter", "no ship '../ships/otter'"),
        ("nowhere.toml", "no such ship file: 'nowhere.toml'"),
        ("", "no ship ''"),
    ],
)
def test_a_ship_that_is_not_there_is_told(name: str, says: str) -> None:
    done = command(main, "vessel", "--ship", name)
    assert done.returncode == 2
    assert says in done.stderr
    assert done.stderr.count("\n") == 1


@settings(max_examples=60, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.data())
def test_a_file_that_is_cut_or_garbled_is_read_or_refused(tmp_path: Path, data: st.DataObject) -> None:
    whole = (ROOT / "ships" / "otter.toml").read_bytes()
    at = data.draw(st.integers(0, len(whole)))
    kept = data.draw(st.sampled_from([at, at + 1, at + 7]))
    garbled = whole[:at] + data.draw(st.binary(max_size=3)) + whole[kept:]
    with suppress(DeclarationError):
        read_ship(written(tmp_path, garbled))


@pytest.mark.parametrize(
    ("product", "name"),
    [
        ("u", "X_u"),
        ("|u|u", "X_absu_u"),
        ("u|u|", "X_absu_u"),
        ("uuu", "X_uuu"),
        ("rv", "X_vr"),
        ("v|r|", "X_absr_v"),
        ("|r||u|v", "X_absu_absr_v"),
        ("|u|v|r|", "X_absu_absr_v"),
        ("|v|", "X_absv"),
    ],
)
def test_a_product_has_one_name_however_it_is_written(product: str, name: str) -> None:
    assert Term(axis="X", product=product, value=1.0).name == name


def test_a_ship_that_is_not_there_is_refused_with_those_that_are(monkeypatch) -> None:
    with pytest.raises(
        DeclarationError, match=r"no ship 'xyz'; there are cse1, .*, or give a .toml file"
    ):
        find_ship("xyz")
    monkeypatch.setattr(ship_file, "shipped_ships", list)
    with pytest.raises(DeclarationError, match=r"no ship 'xyz'; give a .toml file"):
        find_ship("xyz")


@pytest.mark.parametrize("name", shipped_ships())
def test_shipped_ships_say_where_their_numbers_come_from(name: str) -> None:
    found = read_ship(name)
    assert found.source
    parts = [v for part in (*found.functions, *found.actuators) for v in part.values]
    limits = ("n_max", "n_min", "delta_max", "alpha_max")
    for v in (*found.inertia, *found.terms, *parts):
        assert v.value == 0.0 or v.name in limits or v.origin != "guessed", v.name


PAGES = [ROOT / "docs" / name for name in ("ship.md", "actuators.md")]
PAGE = "".join(page.read_text(encoding="utf-8") for page in PAGES)


def test_published_schema_is_that_of_the_code() -> None:
    printed = command(schema_main).stdout
    assert (ROOT / "docs" / "ship.schema.json").read_text(encoding="utf-8") == printed
    json.loads(printed)


def test_the_page_shows_what_is_in_the_file_of_the_otter() -> None:
    blocks = re.findall(r"```toml\n(.*?)```", PAGE, re.DOTALL)
    shown = [line for block in blocks for line in block.splitlines()]
    shipped = (ROOT / "ships" / "otter.toml").read_text(encoding="utf-8")
    assert len(shown) > 30
    assert not [line for line in shown if line.partition(" = ")[0] != "source" and line not in shipped]


@pytest.mark.parametrize(
    "law", [n for n, law in Law.known.items() if law.__module__.startswith("fmus.actuators.")]
)
def test_the_page_has_the_parameters_of_a_law_with_their_units(law: str) -> None:
    (row,) = [line for line in PAGE.splitlines() if line.startswith(f"| `{law}` |")]
    _, commands, _, numbers = row.split(" | ")
    assert re.findall(r"`(\w+)`", commands) == [c.name for c in Law.known[law].commands]
    stated = {
        name: unit
        for names, unit in re.findall(r"((?:`\w+`(?:, )?)+) \[(.+?)\]", numbers)
        for name in re.findall(r"`(\w+)`", names)
    }
    inner = re.compile(r"table_([xy]_)?\d_\d")  # of a table its first and its last cell stand there
    declared = [v for v in variables(Law.known[law].Parameters) if not inner.fullmatch(v.name)]
    declared += [v for v in variables(Law.known[law].Parameters) if v.name.endswith(("_1_1", "_9_3"))]
    assert stated == {v.name: v.unit for v in declared}


def test_the_page_of_parameters_has_the_start_values_of_the_code() -> None:
    """``python tests/support/fmu_variables.py > docs/fmu_variables.md`` brings it up to date."""
    assert (ROOT / "docs" / "fmu_variables.md").read_text(encoding="utf-8") == variables_page()


def test_the_page_has_the_parameters_of_each_function() -> None:
    for name, function in FUNCTIONS.items():
        (row,) = [line for line in PAGE.splitlines() if line.startswith(f"| `{name}` |")]
        for v in parameters_of(name, 3, function):
            assert f"`{v.name}` [{v.unit}]" in row


def test_python_of_the_page_ship_md_runs(capsys: pytest.CaptureFixture[str]) -> None:
    (text,) = re.findall(r"```python\n(.*?)```", PAGE, re.DOTALL)
    exec(compile(text, "ship.md", "exec"), {})
    assert capsys.readouterr().out.strip() == re.findall(r"print\(.*# (.*)", text)[0]


@pytest.mark.slow
@pytest.mark.parametrize("name", shipped_ships())
def test_shipped_ships_are_built(name: str, tmp_path: Path) -> None:
    path = ROOT / "ships" / f"{name}.toml"
    parts = ("vessel", "thrusters", "controller_bs")
    done = command(main, *parts, "--ship", path, "--out", tmp_path)
    assert done.returncode == 0, done.stderr
    assert {p.stem for p in tmp_path.iterdir()} == set(parts)


def test_each_actuator_that_gives_more_than_the_weight_has_a_warning(tmp_path: Path) -> None:
    strong = RIGHT.replace("n_max = 10.0", "n_max = 600.0")
    with warnings.catch_warnings(record=True) as found:
        warnings.simplefilter("always")
        read_ship(written(tmp_path, strong))
    named = [str(w.message).partition("actuator ")[2].partition(" gives")[0] for w in found]
    assert named == ["'port'", "'starboard'"]
