"""Untrusted input: archives that would leave their folder or fill the disk, XML bombs, unknown binaries."""

import ast
import json
import os
import stat
import zipfile

import pytest
from support.command import command
from support.plain import GAIN
from support.project import ROOT

import cosim
from cosim.errors import InputError
from cosim.fmu import archive_check
from cosim.fmu.archive_check import check_archive, unpack
from cosim.formats.ssv import read_parameters
from cosim.run import main as run_main
from fmus.build.__main__ import main as build_main

MODEL = '<fmiModelDescription fmiVersion="2.0"/>'


def archive(path, *entries):
    """A zip archive; an entry is a name, a (name, content) pair or a ZipInfo."""
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as file:
        for entry in entries:
            name, content = entry if isinstance(entry, tuple) else (entry, "")
            file.writestr(name, content)
    return path


def special(kind):
    info = zipfile.ZipInfo("resources/other")
    info.external_attr = (kind | 0o777) << 16
    return info, "/etc/passwd"


def renamed(path, old, new):
    """Write another name over one of an archive: zipfile itself would clean it."""
    path.write_bytes(path.read_bytes().replace(old.encode(), new.encode()))
    return path


@pytest.mark.parametrize(
    ("entries", "message"),
    [
        (["/etc/passwd"], "is not a path inside"),
        (["C:/windows"], "is not a path inside"),
        (["../../evil"], "leads out of the folder"),
        (["resources/../../evil"], "leads out of the folder"),
        (["a/./b"], "some operating systems"),
        (["a//b"], "some operating systems"),
        (["resources/line\nbreak"], "some operating systems"),
        (["resources/point."], "some operating systems"),
        (["resources/aux.txt"], "device of Windows"),
        (["NUL"], "device of Windows"),
        (["resources/com1/x"], "device of Windows"),
        ([special(stat.S_IFLNK)], "is a link or a device"),
        ([special(stat.S_IFIFO)], "is a link or a device"),
        (["resources/a", "resources/A"], "same file on some operating systems"),
        (["resources/caf\u00e9", "resources/cafe\u0301"], "same file on some operating systems"),
        (["resources", "resources/a"], "is a file, and the folder of"),
        (["Resources", "resources/a"], "is a file, and the folder of"),
        (["resources", "resources/a/b/c"], "is a file, and the folder of"),
        (["resources/a/b", "resources/a/b/c/d"], "is a file, and the folder of"),
    ],
)
def test_archive_that_leaves_its_folder_or_means_two_things_is_refused(tmp_path, entries, message):
    path = archive(tmp_path / "x.fmu", ("modelDescription.xml", MODEL), *entries)
    with pytest.raises(InputError, match=message):
        unpack(path, tmp_path / "out")
    assert not (tmp_path / "out").exists()
    with pytest.raises(InputError, match="is refused"):
        cosim.simulate(
            cosim.load_scenario(
                {"name": "x", "step": 0.1, "stop": 1.0, "fmus": {"a": {"path": str(path)}}}
            )
        )


def test_duplicates_backslashes_and_encryption_are_refused(tmp_path):
    path = archive(tmp_path / "a.fmu", "first", "other")
    with pytest.raises(InputError, match="same file on some operating systems"):
        check_archive(renamed(path, "other", "first"))
    path = archive(tmp_path / "b.fmu", "a/b")
    with pytest.raises(InputError, match="backslash"):
        check_archive(renamed(path, "a/b", "a\\b"))
    data = bytearray(archive(tmp_path / "c.fmu", ("name", "secret")).read_bytes())
    for mark, offset in ((b"PK\x03\x04", 6), (b"PK\x01\x02", 8)):
        data[data.index(mark) + offset] |= 1
    (tmp_path / "c.fmu").write_bytes(data)
    with pytest.raises(InputError, match="is encrypted"):
        check_archive(tmp_path / "c.fmu")


def test_bombs_are_refused_before_anything_is_unpacked(tmp_path, monkeypatch):
    zeros = bytes(1 << 20)
    small = {"MOST_FILES": 10, "MOST_BYTES": 8 << 20, "MOST_RATIO": 100.0, "ALWAYS": 1 << 20}
    for name, limit in small.items():
        monkeypatch.setattr(archive_check, name, limit)
    high = archive(tmp_path / "ratio.fmu", *((f"{k}", zeros) for k in range(4)))
    with pytest.raises(InputError, match="100 times the size"):
        unpack(high, tmp_path / "out")
    large = archive(tmp_path / "size.fmu", *((f"{k}", os.urandom(1000) * 1000) for k in range(9)))
    with pytest.raises(InputError, match="at most"):
        unpack(large, tmp_path / "out")
    text = archive(tmp_path / "xml.fmu", ("modelDescription.xml", os.urandom(2000)))
    with monkeypatch.context() as patched:
        patched.setattr(archive_check, "LARGEST_XML", 1000)
        with pytest.raises(InputError, match=r"modelDescription\.xml is larger than 1000 bytes"):
            unpack(text, tmp_path / "out")
    many = archive(tmp_path / "many.fmu", *(f"{k}" for k in range(11)))
    with pytest.raises(InputError, match="11 entries are more than 10"):
        unpack(many, tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_archive_that_lies_about_its_sizes_writes_no_more_than_it_announced(tmp_path):
    path = archive(tmp_path / "lie.fmu", ("a", bytes(1 << 20)))
    data = path.read_bytes()
    path.write_bytes(data.replace((1 << 20).to_bytes(4, "little"), (10).to_bytes(4, "little")))
    (tmp_path / "out").mkdir()
    with pytest.raises(InputError, match="cannot be unpacked"):
        unpack(path, tmp_path / "out")
    assert sum(p.stat().st_size for p in (tmp_path / "out").iterdir()) <= 10


def test_what_is_unpacked_is_what_was_packed(fmus, tmp_path):
    (tmp_path / "out").mkdir()
    unpack(fmus["vessel"], tmp_path / "out")
    with zipfile.ZipFile(fmus["vessel"]) as packed:
        assert {
            str(p.relative_to(tmp_path / "out")) for p in (tmp_path / "out").rglob("*") if p.is_file()
        } == {*packed.namelist()}
        for name in packed.namelist():
            assert (tmp_path / "out" / name).read_bytes() == packed.read(name)


LAUGHS = "".join(f'<!ENTITY l{k} "{10 * f"&l{k - 1};" if k else "ha" * 100}">' for k in range(9))
DOCUMENTS = {
    "bomb": f"<!DOCTYPE x [{LAUGHS}]><x>&l8;</x>",
    "file": '<!DOCTYPE x [<!ENTITY e SYSTEM "file:///etc/passwd">]><x>&e;</x>',
    "other": '<!DOCTYPE x SYSTEM "http://example.com/x.dtd"><x/>',
}


@pytest.mark.parametrize("kind", DOCUMENTS)
def test_xml_with_entities_is_refused_wherever_it_is_read(tmp_path, kind):
    (tmp_path / "x.ssv").write_text(DOCUMENTS[kind])
    with pytest.raises(InputError, match="DOCTYPE"):
        read_parameters(tmp_path / "x.ssv")
    path = archive(tmp_path / "x.fmu", ("modelDescription.xml", DOCUMENTS[kind]))
    content = {"name": "x", "step": 0.1, "stop": 1.0, "fmus": {"a": {"path": str(path)}}}
    with pytest.raises(InputError, match="DOCTYPE"):
        cosim.simulate(cosim.load_scenario(content), tmp_path / "out")
    utf16 = '<?xml version="1.0" encoding="utf-16"?>' + DOCUMENTS[kind]
    (tmp_path / "x.ssv").write_bytes(utf16.encode("utf-16"))
    with pytest.raises(InputError, match="DOCTYPE"):
        read_parameters(tmp_path / "x.ssv")


def test_master_has_no_way_to_run_text():
    """No call of eval, exec, compile or __import__, nothing that unpickles; modules are imported by constants."""
    forbidden = {"eval", "exec", "compile", "__import__"}
    modules = {"pickle", "marshal", "shelve", "yaml", "dill", "code", "runpy"}
    for path in (ROOT / "cosim").rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.Call) and isinstance(node.func, ast.Name):
                assert node.func.id not in forbidden, (path, node.lineno)
            if isinstance(node, (ast.Import, ast.ImportFrom)):
                names = {a.name for a in node.names} | {getattr(node, "module", "") or ""}
                assert not modules & {n.partition(".")[0] for n in names}, (path, node.lineno)


def test_every_reader_of_xml_or_archives_checks_first():
    """Parsing goes with check_xml in the same module; archives are unpacked by cosim.fmu.archive_check alone."""
    parsers = ("ElementTree.fromstring(", "ElementTree.parse(", "ElementTree.iterparse(", "etree.XML(")
    readers = []
    for path in (ROOT / "cosim").rglob("*.py"):
        source = path.read_text()
        assert ".extractall(" not in source, path
        assert ".extract(" not in source, path
        if any(parser in source for parser in parsers):
            assert "check_xml(" in source, path
            readers.append(path.name)
    assert {"fmu_model.py", "ssv.py", "documents.py"} <= set(readers)


def test_text_in_a_scenario_stays_text(ellipse, tmp_path):
    """In every place where a scenario may hold text, code is refused or kept as it is."""
    mark = tmp_path / "mark"
    code = f"__import__('pathlib').Path({str(mark)!r}).touch()"
    places = [("name", code.replace("/", "")), ("description", code)]
    for key, text in places:
        cosim.load_scenario(ellipse | {key: text})
    wrong = [
        {"fmus": {"a": {"path": f"{code}.fmu"}}},
        {"fmus": {"a": {"path": "vessel.fmu", "parameters": {"X_u": code}}}},
        {"fmus": {"a": {"path": "vessel.fmu", "parameters": {code: 1.0}}}},
        {"fmus": {"a": {"path": "guidance_waypoints.fmu", "table": f"{code}.csv"}}},
        {"connections": [[f"vessel.{code}", "observer.x_m"]]},
        {"log": {"signals": [f"vessel.{code}*"]}},
        {"step": code},
    ]
    for change in wrong:
        with pytest.raises(InputError):
            cosim.simulate(cosim.load_scenario(ellipse | change), tmp_path / "out")
    assert not mark.exists()


def only_own(tmp_path, *paths):
    scenario = tmp_path / "scenario.json"
    fmus = {f"m{k}": {"path": str(path)} for k, path in enumerate(paths)}
    scenario.write_text(json.dumps({"name": "s", "step": 0.1, "stop": 0.2, "fmus": fmus}))
    return command(run_main, scenario, "--out", tmp_path / "out", "--no-plots", "--only-own")


def edited(source, target, edit):
    """A copy of an FMU in which ``edit(name, data)`` gives the new content."""
    with zipfile.ZipFile(source) as old:
        content = {name: edit(name, old.read(name)) for name in old.namelist()}
    return archive(target, *content.items())


def test_only_own_takes_what_was_built_here(fmus, tmp_path):
    moved = edited(
        fmus["vessel"],
        tmp_path / "moved.fmu",
        lambda name, data: (
            data.replace(b'start="-0.6555"', b'start="-0.7"') if name.endswith(".xml") else data
        ),
    )
    assert moved.read_bytes() != fmus["vessel"].read_bytes()
    done = only_own(tmp_path, "vessel.fmu", fmus["thrusters"], moved)
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize(
    ("prefix", "suffix"),
    [("binaries/linux64/", ".so"), ("resources/vessel_", "hull.py"), ("resources/", "fmi2slave.py")],
)
def test_only_own_refuses_one_changed_program_file(fmus, tmp_path, prefix, suffix):
    def edit(name, data):
        return data + b" " if name.startswith(prefix) and name.endswith(suffix) else data

    done = only_own(tmp_path, "vessel.fmu", edited(fmus["vessel"], tmp_path / "other.fmu", edit))
    assert done.returncode == 2
    assert "was not built here: it holds 'resources/" in done.stderr or "holds 'binaries/" in done.stderr
    assert suffix in done.stderr
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("library", ["../../documentation/evil", "C:evil"])
def test_library_is_never_looked_for_elsewhere(fmus, tmp_path, library):
    """The hashes cover the folder of libraries; a model description could point out of it."""

    def edit(name, data):
        old, new = b'modelIdentifier="vessel"', f'modelIdentifier="{library}"'.encode()
        return data.replace(old, new) if name == "modelDescription.xml" else data

    done = only_own(tmp_path, edited(fmus["vessel"], tmp_path / "other.fmu", edit))
    assert done.returncode == 2
    assert "is not an identifier" in done.stderr


def test_only_own_refuses_a_python_fmu_of_others(plain_fmu, tmp_path):
    """Its binaries are those of the installed pythonfmu; the program is its Python."""
    fmu = plain_fmu("Stranger", GAIN)
    done = only_own(tmp_path, fmu)
    assert done.returncode == 2
    assert "it holds 'resources/Stranger.py'" in done.stderr


def test_builder_verifies_files(fmus, tmp_path):
    def verify(path):
        return command(build_main, "--verify", path)

    done = verify(fmus["vessel"])
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")
    (tmp_path / "no.fmu").write_bytes(b"no zip")
    for path in (tmp_path / "no.fmu", tmp_path / "nowhere.fmu"):
        done = verify(path)
        assert done.returncode == 2
        assert done.stderr.count("\n") == 1
