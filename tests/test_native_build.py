"""Building native FMUs: learned values, users' effects, the cache, and what is refused."""

import math
import struct

import pytest
from support import ccode
from support.command import command

from fmus.build import build, building, platforms, released
from fmus.build.__main__ import main
from fmus.build.building import own_source
from fmus.build.platforms import native_targets
from fmus.effects import STANDARD
from fmus.native import compilers

pytestmark = pytest.mark.skipif(ccode.COMPILER is None, reason="no C compiler on this machine")


SET = """<ssv:ParameterSet xmlns:ssv="http://ssp-standard.org/SSP1/SystemStructureParameterValues"
 version="1.0" name="m"><ssv:Parameters><ssv:Parameter name="vessel.delta_X_u"><ssv:Real value="-3.5"/>
</ssv:Parameter></ssv:Parameters></ssv:ParameterSet>"""


def test_learned_vessel_starts_with_what_was_learned(tmp_path, opened_here):
    (tmp_path / "model.ssv").write_text(SET)
    for options, name in (([], "python"), (["--native"], "native")):
        arguments = [*options, "--parameters", tmp_path / "model.ssv", "--out", tmp_path / name]
        done = command(main, *arguments)
        assert done.stdout.split() == [str(tmp_path / name / "vessel.fmu")], done.stderr
    rows = [
        opened_here(tmp_path / n / "vessel.fmu").initialise(u_0=0.2).play(0)
        for n in ("native", "python")
    ]
    assert rows[0] == rows[1]
    assert opened_here(tmp_path / "native" / "vessel.fmu").get("delta_X_u") == [-3.5]


def test_universal_library_has_each_machine_at_a_page_of_its_own():
    """As Apple's mach-o/fat.h says: big-endian, magic number, count, then five words for each machine."""
    made = [
        struct.pack("<III", 0xFEEDFACF, kind, kind + 1) + bytes([kind]) * size
        for kind, size in ((7, 20001), (12, 5))
    ]
    whole = compilers.universal(made)
    assert struct.unpack_from(">II", whole) == (0xCAFEBABE, 2)
    for k, library in enumerate(made):
        kind, subkind, offset, size, low_bits = struct.unpack_from(">IIIII", whole, 8 + 20 * k)
        assert (kind, subkind) == struct.unpack_from("<II", library, 4)
        assert low_bits == 14
        assert offset % 2**14 == 0
        assert whole[offset : offset + size] == library
    assert offset + size == len(whole)


def test_compiler_tells_its_version_and_what_it_misses(tmp_path):
    target = platforms.this_platform()
    assert any(letter.isdigit() for letter in compilers.compiler_for(target).version)
    (tmp_path / "wrong.c").write_text("int f(void) { return missing; }")
    with pytest.raises(compilers.CompilerError, match=r"error.*missing"):
        compilers.compiled(tmp_path / "wrong.c", target, tmp_path)


EFFECT = '''
from typing import Annotated
from fmus.effects import effect
from fmus.ops import exp

@effect("X_soft", kind="force", axis="X", formula="X = k (1 - exp(-u u))", linear=False)
def X_soft(ship, X_soft: Annotated[float, "N", "a soft force"] = 0.0):
    """A soft force."""
    return X_soft * (1.0 - exp(-ship.u * ship.u)), 0.0, 0.0
'''


def test_users_effect_is_compiled(tmp_path, opened_here):
    (tmp_path / "soft.py").write_text(EFFECT)
    effects = STANDARD.plus_file(tmp_path / "soft.py")
    (path,) = build(["vessel"], tmp_path, effects=effects, native=native_targets())
    fmu = opened_here(path).initialise(u_0=0.3, X_soft=2.0)
    fmu.step(0.0)
    (force, u) = fmu.get("force_X_soft", "u")
    assert force == pytest.approx(2.0 * (1.0 - math.exp(-u * u)), rel=1e-12)


def test_nothing_to_verify_or_to_list_is_reported(monkeypatch):
    monkeypatch.setattr("fmus.build.__main__.came_compiled", lambda name: False)
    for options, said in (
        (["--verify"], "needs the name"),
        (["--list", "--native"], "no FMU is precompiled"),
    ):
        done = command(main, *options)
        assert (done.returncode, done.stdout, said in done.stderr) == (2, "", True)


def test_builds_are_kept_and_repeatable(native, tmp_path, monkeypatch):
    assert build(["vessel"], native=native_targets()) == [native["vessel"]]
    assert command(main, "--verify", native["vessel"]).returncode == 0
    monkeypatch.setenv("CYBERSHIP_CACHE", str(tmp_path))
    (again,) = build(["observer_mdf"], native=native_targets())
    assert again.read_bytes() == native["observer_mdf"].read_bytes()


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--native", "--target", "linux"], "did you mean 'linux64'"),
        (["--native", "--target", "python"], "no platform to compile for"),
        (["--native", "vesel"], "did you mean 'vessel'"),
        (["--target", "linux64"], "need --native"),
    ],
)
def test_what_cannot_be_compiled_is_refused_in_one_line(arguments, message):
    done = command(main, *arguments)
    assert done.returncode == 2
    assert message in done.stderr.splitlines()[-1]


def test_without_a_compiler_one_line_says_what_to_install(monkeypatch, tmp_path):
    monkeypatch.setattr(compilers.shutil, "which", lambda name: None)
    monkeypatch.setattr(compilers.importlib.util, "find_spec", lambda name: None)
    done = command(main, "--native", "vessel")
    assert (done.returncode, len(done.stderr.splitlines())) == (2, 1)
    assert "cybership[native]" in done.stderr
    assert command(main, "--native", "vessel", "--source", tmp_path).returncode == 0


def test_compiler_that_fails_is_told(monkeypatch, tmp_path):
    broken = compilers.Compiler((("false",),), (), "")
    for module in (platforms, compilers):
        monkeypatch.setattr(module, "compiler_for", lambda target: broken)
    monkeypatch.setenv("CYBERSHIP_CACHE", str(tmp_path))
    done = command(main, "--native", "observer_mdf")
    assert done.returncode == 2
    assert "compiler 'false' fails" in done.stderr
    assert not list(tmp_path.rglob("*.fmu"))


@pytest.fixture
def came_along(native, tmp_path, monkeypatch):
    """A package with a compiled FMU of this source, a computer without a compiler, and an empty cache."""
    released.release([native["observer_mdf"]], own_source(), tmp_path / "released")
    monkeypatch.setattr(released, "FOLDER", tmp_path / "released")
    monkeypatch.setattr(compilers.shutil, "which", lambda name: None)
    monkeypatch.setattr(compilers.importlib.util, "find_spec", lambda name: None)
    monkeypatch.setenv("CYBERSHIP_CACHE", str(tmp_path / "cache"))
    return tmp_path / "released" / compilers.this_platform()


def test_compiled_fmu_of_the_package_is_taken_where_it_fits(native, came_along, opened_here):
    assert command(main, "--list", "--native").stdout.split()[:1] == ["observer_mdf"]
    (path,) = build(["observer_mdf"], native=native_targets())
    assert path.read_bytes() == native["observer_mdf"].read_bytes()
    assert command(main, "--verify", path).returncode == 0
    assert opened_here(path).initialise().play(0) == opened_here(native[path.stem]).initialise().play(0)


def test_compiled_fmu_of_the_package_is_left_alone_elsewhere(came_along, tmp_path, monkeypatch):
    (tmp_path / "model.ssv").write_text(SET.replace("vessel.delta_X_u", "observer_mdf.x_m"))
    parameters = ["--parameters", tmp_path / "model.ssv"]
    for other in (
        ["vessel"],
        ["observer_mdf", *parameters],
        ["observer_mdf", "--target", "linux64,python"],
    ):
        assert "there is no C compiler" in command(main, "--native", *other).stderr
    fmu = came_along / "observer_mdf.fmu"
    content = fmu.read_bytes()
    fmu.write_bytes(content[:-1])
    assert command(main, "--list", "--native").stdout == ""
    fmu.write_bytes(content)
    monkeypatch.setattr(building, "own_source", lambda: "of a changed source")
    assert command(main, "--list", "--native").stdout == ""
    assert command(main, "--native", "observer_mdf").returncode == 2
