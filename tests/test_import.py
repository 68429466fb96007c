"""Systems of other tools as scenarios: what is read, and what ends in a message."""

import json
import math
import re
import shutil
import zipfile

import pytest
from support.exchanged import log_of, write

import cosim
from cosim import InputError
from cosim.export import export_osp, export_ssp
from cosim.fmu import FmuModel
from cosim.formats.namespaces import SSM
from cosim.scenario import load_scenario
from cosim.system import prepare


@pytest.mark.parametrize("kind", ["ssp", "osp"])
def test_round_trip_gives_the_same_log(own, tmp_path, kind):
    path = tmp_path / ("system.ssp" if kind == "ssp" else "osp")
    assert write(own, path, export_ssp if kind == "ssp" else export_osp) == []
    _, before = log_of(own, tmp_path / "before")
    result, after = log_of(path, tmp_path / "after")
    assert before == after
    described = json.loads((result.folder / "log.json").read_text())
    assert described["scenario"]["step"] == own["step"]
    assert "jacobi" in described["notes"][-1]


def test_osp_structure_file_is_a_scenario(portable, tmp_path):
    write(portable, tmp_path / "osp", export_osp)
    _, whole = log_of(tmp_path / "osp", tmp_path / "a")
    _, file = log_of(tmp_path / "osp" / "OspSystemStructure.xml", tmp_path / "b")
    assert whole == file


# What a foreign archive may hold: edits of SystemStructure.ssd, and the message or the last gain.y.
BINDING = (
    '<ssd:ParameterBindings><ssd:ParameterBinding{}><ssd:ParameterValues><ssv:ParameterSet version="1.0" '
    'name="p"><ssv:Parameters>{}</ssv:Parameters></ssv:ParameterSet></ssd:ParameterValues>{}'
    "</ssd:ParameterBinding></ssd:ParameterBindings>"
)
SIX = '<ssv:Parameter name="{}"><ssv:Real value="6.0"/></ssv:Parameter>'
# Two FMUs, the ramp in deg and the gain in rad: what the gain gets of the ramp's last but one value, 1.75.
RAD = math.pi / 180.0
LINEAR = '<ssc:LinearTransformation factor="2.0" offset="1.0"/>'
MAPPING = (
    '<ssd:ParameterMapping><ssm:ParameterMapping version="1.0"><ssm:MappingEntry source="stiff" target="k">'
    '<ssc:LinearTransformation factor="0.5" offset="1.0"/></ssm:MappingEntry></ssm:ParameterMapping>'
    "</ssd:ParameterMapping>"
)
SYSTEM = "<ssd:Elements>"
NOTES = '<ssm:Annotations><ssc:Annotation type="x"/></ssm:Annotations></ssm:MappingEntry>'
ANNOTATED = MAPPING.replace("</ssm:MappingEntry>", NOTES)


@pytest.mark.parametrize(
    ("edits", "factor"),
    [
        ([], 3.0),
        ([(SYSTEM, BINDING.format("", SIX.format("gain.k"), "") + SYSTEM)], 6.0),
        ([(SYSTEM, BINDING.format(' prefix="gain."', SIX.format("k"), "") + SYSTEM)], 6.0),
        ([(SYSTEM, BINDING.format("", SIX.format("stiff"), MAPPING.replace('"k"', '"gain.k"')) + SYSTEM)], 4.0),
        ([(SYSTEM, BINDING.format("", SIX.format("stiff"), ANNOTATED.replace('"k"', '"gain.k"')) + SYSTEM)], 4.0),
        ([('endConnector="u" />', 'endConnector="u"><ssc:LinearTransformation factor="2"/></ssd:Connection>')], 6.0),
    ],
    ids=["component", "system", "prefix", "mapping", "annotated", "transformation"],
)  # fmt: skip
def test_what_ssp_archives_may_hold(chain, tmp_path, edits, factor):
    path = edited(chain, tmp_path, edits)
    result, _ = log_of(path, tmp_path / "out")
    log = cosim.read_log(result.folder, ["gain.y"])
    assert log["gain.y"][-1] == factor * 1.75


@pytest.mark.parametrize(
    ("attribute", "inside", "expected"),
    [
        ("", "", 1.75 * RAD),
        ("", LINEAR, 2.0 * 1.75 * RAD + 1.0),
        ('suppressUnitConversion="true"', "", 1.75),
        ('suppressUnitConversion="1"', LINEAR, 2.0 * 1.75 + 1.0),
        ('suppressUnitConversion="false"', LINEAR, 2.0 * 1.75 * RAD + 1.0),
    ],
)
def test_a_transformation_comes_after_the_conversion_of_units(
    angles, tmp_path, attribute, inside, expected
):
    angles["transformations"] = {"gain.u": {}}  # without it, a conversion cannot be exported
    wire = 'endConnector="u" suppressUnitConversion="true" />'
    path = edited(angles, tmp_path, [(wire, f'endConnector="u" {attribute}>{inside}</ssd:Connection>')])
    result, _ = log_of(path, tmp_path / "out")
    assert cosim.read_log(result.folder, ["gain.u"])["gain.u"][-1] == pytest.approx(expected)


def test_a_mapping_of_nothing_is_told(chain, tmp_path):
    path = edited(chain, tmp_path, [(SYSTEM, BINDING.format("", SIX.format("stif"), MAPPING) + SYSTEM)])
    notes = load_scenario(path).notes
    assert any("no parameter 'stiff'" in note and "did you mean 'stif'" in note for note in notes)


@pytest.mark.parametrize("name", ["gain.k", "stiff"])
def test_values_of_another_unit_are_refused(angles, tmp_path, name):
    """But for a mapping that wants no conversion."""
    angles["transformations"] = {"gain.u": {}}
    value = SIX.format(name).replace("6.0", '6.0" unit="deg')
    mapping = MAPPING.replace('"k"', '"gain.k"') if name == "stiff" else ""
    path = edited(angles, tmp_path, [(SYSTEM, BINDING.format("", value, mapping) + SYSTEM)])
    with pytest.raises(InputError, match=r"gain\.k is in 'deg', but the FMU's unit is 'rad'"):
        load_scenario(path)
    if mapping:
        kept = mapping.replace("source=", 'suppressUnitConversion="true" source=')
        path = edited(angles, tmp_path, [(SYSTEM, BINDING.format("", value, kept) + SYSTEM)])
        assert load_scenario(path).fmus["gain"].parameters["k"] == 4.0


@pytest.mark.parametrize(
    ("edits", "message"),
    [
        ([("<ssd:Elements>", '<ssd:Elements><ssd:System name="inner"/>')], "nested systems are not supported"),
        *[([(SYSTEM, BINDING.format(f' {kind}', "", "") + SYSTEM)], "kind of parameter binding is not supported")
          for kind in ('type="text/csv"', 'sourceBase="component"')],
        ([(SYSTEM, "<ssd:SignalDictionaries/>" + SYSTEM)], "signal dictionaries are not supported"),
        ([("resources/gain.fmu", "resources/ramps.fmu")], "did you mean 'resources/ramp.fmu'"),
        ([("resources/gain.fmu", "http://example.org/gain.fmu")], "is not a file"),
        ([("resources/gain.fmu", "../../gain.fmu")], "has no '../../gain.fmu'"),
        ([('startElement="ramp"', 'startElement="rump"')], "there is no 'rump'; did you mean 'ramp'"),
        ([("x-fmu-sharedlibrary", "x-ssp-package")], "type 'application/x-ssp-package' is not supported"),
        ([('startTime="0.0"', 'startTime="5.0"')], "starts at 5.0 s"),
        ([(' stopTime="1.0"', "")], "does not state its stop; give --stop"),
        ([('version="1.0" name="chain"', 'version="2.0" name="chain"')], "is of SSP 2.0"),
        ([('<ssv:Real value="3.0"', '<ssv:Real value="three"')], "gain.*k = 'three' is not a number"),
        ([('<ssv:Real value="3.0"', '<ssv:Binary value="00"')], "values of type Binary are not supported"),
        ([("resources/gain.fmu", "http://[::1")], "'http://\\[::1' is not a file"),
        ([('startConnector="y"', 'startConnector="*"'), ('endConnector="u"', 'endConnector="*"')],
         r"'ramp' has no variable '\*'"),
        ([('<ssv:Real value="3.0"', '<ssv:Real value="1_0"')], "k = '1_0' is not a number"),
        ([('<ssv:Real value="3.0"', '<ssv:Integer value="1_0"')], "k = '1_0' is not a whole number"),
        ([('stopTime="1.0"', 'stopTime="1_0"')], "stopTime = '1_0' is not a number"),
        ([(SYSTEM, BINDING.format("", SIX.format("stiff").replace("Real", "String"), MAPPING) + SYSTEM)],
         "mapping of 'stiff': a LinearTransformation needs a number, not '6.0'"),
        ([('endConnector="u" />', 'endConnector="u"><ssc:BooleanMappingTransformation/></ssd:Connection>')],
         "BooleanMappingTransformation is not supported"),
        ([("</ssd:Elements>", "")], "cannot be read"),
        ([("<ssd:SystemStructureDescription", '<!DOCTYPE x [<!ENTITY a "aaaa">]>\n<ssd:SystemStructureDescription')],
         "declares a document type"),
    ],
)  # fmt: skip
def test_what_ssp_archives_may_not_hold(chain, tmp_path, edits, message):
    path = edited(chain, tmp_path, edits)
    with pytest.raises(InputError, match=message):
        prepare(load_scenario(path)).close()


def edited(chain, tmp_path, edits):
    """Path of the chain as an archive, with the structure changed."""
    source, path = tmp_path / "plain.ssp", tmp_path / "edited.ssp"
    write(chain, source, export_ssp)
    with zipfile.ZipFile(source) as old, zipfile.ZipFile(path, "w") as new:
        for name in old.namelist():
            content = old.read(name)
            if name == "SystemStructure.ssd":
                text = content.decode().replace("xmlns:ssd=", f'xmlns:ssm="{SSM}" xmlns:ssd=', 1)
                for before, after in edits:
                    assert before in text
                    text = text.replace(before, after)
                content = text.encode()
            new.writestr(name, content)
    return path


@pytest.mark.parametrize(
    "packing", [zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED, zipfile.ZIP_BZIP2, zipfile.ZIP_LZMA]
)
def test_damaged_archives_are_told(tmp_path, packing):
    path = tmp_path / "a.ssp"
    with zipfile.ZipFile(path, "w", packing) as archive:
        archive.writestr("SystemStructure.ssd", bytes(range(256)) * 16)
    content = bytearray(path.read_bytes())
    content[50:90] = bytes(255 - byte for byte in content[50:90])
    path.write_bytes(content)
    with pytest.raises(InputError, match=r"'SystemStructure\.ssd' cannot be unpacked"):
        load_scenario(path)


def test_junk_in_an_archive_is_named_by_the_archive(chain, tmp_path):
    path = edited(chain, tmp_path, [])
    with zipfile.ZipFile(path) as archive:
        structure = archive.read("SystemStructure.ssd")
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("SystemStructure.ssd", structure)
        archive.writestr("resources/ramp.fmu", "junk")
    with pytest.raises(InputError, match=r"edited\.ssp/resources/ramp\.fmu' is not a zip archive"):
        load_scenario(path)


FUNCTION = '<Functions><LinearTransformation name="f"/></Functions><Connections>'
Y, U = '<Variable simulator="ramp" name="y"/>', '<Variable simulator="gain" name="u"/>'


@pytest.mark.parametrize(
    ("edit", "message"),
    [
        (("fixedStep", "ecco"), "the algorithm 'ecco' is not supported"),
        (("<StartTime>0.0", "<StartTime>2.0"), "starts at 2 s"),
        (("</Simulators>", '</Simulators><Functions><Sum name="s" inputCount="2"/></Functions>'), "Sum is not supported"),
        (('source="gain.fmu"', 'source="proxyfmu://host?file=gain.fmu"'), "is not a file"),
        (('source="gain.fmu"', 'source="gone.fmu"'), "no such FMU"),
        (('simulator="ramp"', 'simulator="rump"'), "there is no 'rump'; did you mean 'ramp'"),
        (('value="3.0"', 'value="x"'), "k = 'x' is not a number"),
        (("</OspSystemStructure>", ""), "cannot be read"),
        (('source="gain.fmu"', 'source="http://[::1"'), "is not a file"),
        (('source="gain.fmu"', f'source="{"x" * 300}.fmu"'), "no such FMU"),
        (('source="gain.fmu"', f'source="{"x" * 5000}.fmu"'), "is not a file"),
        (('name="y"', 'name="y*"'), r"'ramp' has no variable 'y\*'; did you mean 'y'"),
        (('value="3.0" />', 'value="3.0" /><Real value="4.0" />'), "k needs one value, not 2"),
        (("<Connections>", "<Connections><VariableConnection/>"), "needs a Variable and a Variable"),
        (("<Connections>", f"<Connections><VariableConnection>{Y}</VariableConnection>"), "a Variable and a Variable"),
        (("</VariableConnection>", f"{Y}</VariableConnection>"), "needs a Variable and a Variable"),
        (("<Connections>", "<Connections><VariableGroupConnection/>"), "a VariableGroup and a VariableGroup"),
        (("<Connections>", f'{FUNCTION}<SignalConnection><Signal function="f" name="in"/></SignalConnection>'),
         "a SignalConnection needs a Variable and a Signal"),
        (("<Connections>", f"{FUNCTION}<SignalConnection>{Y}</SignalConnection>"), "a Variable and a Signal"),
        (("<Connections>", f'{FUNCTION}<SignalConnection>{U}<Signal function="f" name="o"/></SignalConnection>'),
         "'f' has no signal 'o'; there are in, out"),
        (("<Connections>", f'{FUNCTION}<SignalConnection>{U}<Signal function="g" name="out"/></SignalConnection>'),
         "no function 'g'"),
        (("<Connections>", FUNCTION.replace("</F", '<LinearTransformation name="f"/></F')), "'f' occurs twice"),
    ],
)  # fmt: skip
def test_what_osp_directories_may_not_hold(chain, tmp_path, edit, message):
    write(chain, tmp_path / "osp", export_osp)
    structure = tmp_path / "osp" / "OspSystemStructure.xml"
    assert edit[0] in structure.read_text()
    structure.write_text(structure.read_text().replace(*edit))
    with pytest.raises(InputError, match=message):
        prepare(load_scenario(tmp_path / "osp")).close()


def test_an_osp_scenario_of_great_depth_is_told(chain, tmp_path):
    write(chain, tmp_path / "osp", export_osp)
    (tmp_path / "osp" / "scenarios" / "chain.json").write_text("[" * 100_000)
    with pytest.raises(InputError, match="cannot be read as an OSP scenario"):
        load_scenario(tmp_path / "osp")


def test_osp_connections_convert_only_what_they_say(angles, tmp_path):
    """As in libcosim: an export says it, and a plain connection passes values on."""
    write(angles, tmp_path / "osp", export_osp)
    _, before = log_of(angles, tmp_path / "before")
    _, after = log_of(tmp_path / "osp", tmp_path / "after")
    assert before == after
    angles["transformations"] = {"gain.u": {}}
    write(angles, tmp_path / "osp", export_osp)
    result, plain = log_of(tmp_path / "osp", tmp_path / "plain")
    assert plain == log_of(angles, tmp_path / "kept")[1] != before
    described = json.loads((result.folder / "log.json").read_text())
    assert any("in 'deg' and 'rad'; values pass unchanged" in note for note in described["notes"])


GROUPS = (
    '<OspModelDescription xmlns="https://open-simulation-platform.com/OspModelDescription/1.0.0" version="1.0">'
    '<VariableGroups><Generic name="all"><Generic name="one">{}</Generic></Generic></VariableGroups>'
    "</OspModelDescription>"
)


@pytest.mark.parametrize(
    ("first", "second", "message"),
    [
        ('<Variable ref="y"/>', '<Variable ref="u"/>', None),
        ('<Variable ref="y"/>', "", "ramp.all and gain.all differ in size: 1 and 0"),
        ('<Variable ref="y"/>', '<Variable ref="w"/>', "'gain' has no variable 'w'"),
        ('<Variable ref="y"/>', None, "gain.all needs '.*_OspModelDescription.xml'"),
    ],
)
def test_connected_groups_are_their_variables_connected_in_turn(chain, tmp_path, first, second, message):
    write(chain, tmp_path / "osp", export_osp)
    plain = load_scenario(tmp_path / "osp").connections
    structure = tmp_path / "osp" / "OspSystemStructure.xml"
    text = structure.read_text()
    for end in ("ramp", "gain"):
        text = re.sub(
            f'<Variable simulator="{end}" name="."', f'<VariableGroup simulator="{end}" name="all"', text
        )
    structure.write_text(text.replace("VariableConnection", "VariableGroupConnection"))
    for end, members in (("ramp", first), ("gain", second)):
        name = FmuModel(tmp_path / "osp" / f"{end}.fmu").name
        if members is not None:
            (tmp_path / "osp" / f"{name}_OspModelDescription.xml").write_text(GROUPS.format(members))
    if message is None:
        assert load_scenario(tmp_path / "osp").connections == plain
    else:
        with pytest.raises(InputError, match=message):
            load_scenario(tmp_path / "osp")


def test_several_osp_scenarios_leave_the_choice(chain, tmp_path):
    write(chain, tmp_path / "osp", export_osp)
    folder = tmp_path / "osp" / "scenarios"
    shutil.copyfile(folder / "chain.json", folder / "other.json")
    with pytest.raises(InputError, match="does not state its stop"):
        load_scenario(tmp_path / "osp")
    scenario = load_scenario(tmp_path / "osp", {"stop": 2.0})
    assert "one of several scenarios" in scenario.notes[0]


def test_unpacked_archives_are_removed_after_their_last_use(chain, tmp_path):
    write(chain, tmp_path / "chain.ssp", export_ssp)
    scenario = load_scenario(tmp_path / "chain.ssp")
    folder = scenario.folder
    assert folder.is_dir()
    del scenario
    assert not folder.exists()


def test_the_command_line_runs_an_archive(chain, tmp_path, capsys):
    from cosim.run import main as run

    write(chain, tmp_path / "chain.ssp", export_ssp)
    command = [str(tmp_path / "chain.ssp"), "--out", str(tmp_path / "out"), "--no-plots"]
    assert run([*command, "--stop", "2", "--step", "0.5"]) == 0
    assert "5 rows" in capsys.readouterr().out
    assert run([*command[:1], "--stop", "2.1", *command[1:]]) == 2
    assert "not a multiple" in capsys.readouterr().err
