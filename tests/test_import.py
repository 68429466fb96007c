"""Systems of other tools as scenarios: what is read, and what ends in a message."""

import json
import shutil
import zipfile

import pytest
from exchanged import log_of, write

import cosim
from cosim import InputError
from cosim.exchange.bindings import MAPPINGS
from cosim.export import export_osp, export_ssp
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
MAPPING = (
    '<ssd:ParameterMapping><ssm:ParameterMapping version="1.0"><ssm:MappingEntry source="stiff" target="k">'
    '<ssc:LinearTransformation factor="0.5" offset="1.0"/></ssm:MappingEntry></ssm:ParameterMapping>'
    "</ssd:ParameterMapping>"
)
SYSTEM = "<ssd:Elements>"


@pytest.mark.parametrize(
    ("edits", "factor"),
    [
        ([], 3.0),
        ([(SYSTEM, BINDING.format("", SIX.format("gain.k"), "") + SYSTEM)], 6.0),
        ([(SYSTEM, BINDING.format(' prefix="gain."', SIX.format("k"), "") + SYSTEM)], 6.0),
        ([(SYSTEM, BINDING.format("", SIX.format("stiff"), MAPPING.replace('"k"', '"gain.k"')) + SYSTEM)], 4.0),
        ([('endConnector="u" />', 'endConnector="u"><ssc:LinearTransformation factor="2"/></ssd:Connection>')], 6.0),
    ],
    ids=["component", "system", "prefix", "mapping", "transformation"],
)  # fmt: skip
def test_what_ssp_archives_may_hold(chain, tmp_path, edits, factor):
    path = edited(chain, tmp_path, edits)
    result, _ = log_of(path, tmp_path / "out")
    log = cosim.read_log(result.folder, ["gain.y"])
    assert log["gain.y"][-1] == factor * 1.75


@pytest.mark.parametrize(
    ("edits", "message"),
    [
        ([("<ssd:Elements>", '<ssd:Elements><ssd:System name="inner"/>')], "nested systems are not supported"),
        ([(SYSTEM, "<ssd:SignalDictionaries/>" + SYSTEM)], "signal dictionaries are not supported"),
        ([("resources/gain.fmu", "resources/ramps.fmu")], "did you mean 'resources/ramp.fmu'"),
        ([("resources/gain.fmu", "http://example.org/gain.fmu")], "is not a file"),
        ([("resources/gain.fmu", "../../gain.fmu")], "has no '../../gain.fmu'"),
        ([('startElement="ramp"', 'startElement="rump"')], "there is no 'rump'; did you mean 'ramp'"),
        ([("x-fmu-sharedlibrary", "x-ssp-package")], "type 'application/x-ssp-package' is not supported"),
        ([('startTime="0.0"', 'startTime="5.0"')], "starts at 5.0 s"),
        ([(' stopTime="1.0"', "")], "does not say its stop; give it by --stop"),
        ([('version="1.0" name="chain"', 'version="2.0" name="chain"')], "is of SSP 2.0"),
        ([('<ssv:Real value="3.0"', '<ssv:Real value="three"')], "gain.*k = 'three' is not a number"),
        ([('<ssv:Real value="3.0"', '<ssv:Binary value="00"')], "values of type Binary are not supported"),
        ([('endConnector="u"', 'endConnector="u" suppressUnitConversion="true"')], "suppressUnitConversion"),
        ([('endConnector="u" />', 'endConnector="u"><ssc:BooleanMappingTransformation/></ssd:Connection>')],
         "BooleanMappingTransformation is not supported"),
        ([("</ssd:Elements>", "")], "cannot be read"),
        ([("<ssd:SystemStructureDescription", '<!DOCTYPE x [<!ENTITY a "aaaa">]>\n<ssd:SystemStructureDescription')],
         "document type, which is refused"),
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
                text = content.decode().replace("xmlns:ssd=", f'xmlns:ssm="{MAPPINGS}" xmlns:ssd=', 1)
                for before, after in edits:
                    assert before in text
                    text = text.replace(before, after)
                content = text.encode()
            new.writestr(name, content)
    return path


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
    ],
)  # fmt: skip
def test_what_osp_directories_may_not_hold(chain, tmp_path, edit, message):
    write(chain, tmp_path / "osp", export_osp)
    structure = tmp_path / "osp" / "OspSystemStructure.xml"
    assert edit[0] in structure.read_text()
    structure.write_text(structure.read_text().replace(*edit))
    with pytest.raises(InputError, match=message):
        prepare(load_scenario(tmp_path / "osp")).close()


def test_several_osp_scenarios_leave_the_choice(chain, tmp_path):
    write(chain, tmp_path / "osp", export_osp)
    folder = tmp_path / "osp" / "scenarios"
    shutil.copyfile(folder / "chain.json", folder / "other.json")
    with pytest.raises(InputError, match="does not say its stop"):
        load_scenario(tmp_path / "osp")
    scenario = load_scenario(tmp_path / "osp", {"stop": 2.0})
    assert "none of several scenarios" in scenario.notes[0]


def test_unpacked_archives_go_when_nobody_needs_them(chain, tmp_path):
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
