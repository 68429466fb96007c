"""Where people work: the packages from Python, the command ``cybership``, logs, folders, beliefs."""

import argparse
import importlib.util
import json
import os
import re
import shutil
import subprocess
import sys
import threading
from importlib.metadata import EntryPoint
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from support.project import ROOT

import cosim
import diagnosis
import fmus
from cosim import command, run
from cosim.command import missing_extra
from cosim.master import simulation
from cosim.results import draw
from cosim.results.picture_files import PictureOptions
from cosim.results.result_files import default_folder
from cosim.scenario import Roles, load_scenario
from cosim.system import prepare
from cybership import completion, subcommands
from cybership.__main__ import main, usage
from cybership.subcommands import GROUP, SUBCOMMANDS, all_modules, purpose
from diagnosis.commands import command_line
from diagnosis.execution import result_folder
from diagnosis.verdict import shares
from fmus.build import BuildError

SHORT = {"stop": 1.0, "metrics": {}}


@pytest.mark.parametrize("package", [cosim, diagnosis, fmus], ids=lambda p: p.__name__)
def test_public_names_are_complete_and_typed(package):
    assert dir(package) == sorted(package.__all__)
    assert (Path(package.__file__).parent / "py.typed").is_file()


def test_a_run_by_name_has_log_metrics_and_pictures(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    result = cosim.simulate("ellipse", seed=3, set=SHORT | {"vessel.m": 15})
    assert result.folder == Path("results", "ellipse")
    assert len(result.log) == result.rows == 101
    assert result.log.attrs["units"]["vessel.u"] == "m/s"
    assert result.plot("errors")._repr_png_().startswith(b"\x89PNG")
    assert "<svg" in result.plot().save("new/track.svg").read_text()
    ran = json.loads(Path("results/ellipse/log.json").read_text())["scenario"]
    assert (ran["seed"], ran["fmus"]["vessel"]["parameters"]["m"]) == (3, 15)
    with pytest.raises(cosim.InputError, match="did you mean 'errors'"):
        result.plot("error")


@pytest.mark.parametrize(
    ("call", "line"),
    [
        (lambda: cosim.simulate("ellipse", stop=1, set={"vessel.m": float("nan")}), "vessel.m cannot be nan"),
        (lambda: cosim.simulate("ellipse", stop=1, set=["vessel.m=1"]), "set is a dict of paths and values"),
        (lambda: cosim.simulate("ellipse", stop=1, log="al"), "log is 'all' or 'compact', not 'al'"),
        (lambda: cosim.load_scenario(3), "not of type int"),
        (lambda: cosim.simulate("ellipse", stop=1, parameters="/"), "'/' is a folder; a parameter set is a file"),
        (lambda: diagnosis.load([]), "there is no run to read"),
        (lambda: diagnosis.diagnose([]), "there is no run to read"),
        (lambda: diagnosis.load(3), "not of type int"),
        (lambda: fmus.build_fmus("vesel", "out"), "no FMU 'vesel'; did you mean 'vessel'"),
        (lambda: fmus.build_fmus(None, "out"), "not by NoneType"),
        (lambda: fmus.build_fmus("mine.py"), "no such component file: 'mine.py'"),
    ],
)  # fmt: skip
def test_what_was_meant_is_one_line(tmp_path, monkeypatch, call, line):
    monkeypatch.chdir(tmp_path)
    with pytest.raises((cosim.InputError, BuildError)) as stated:
        call()
    assert line in str(stated.value)
    assert "\n" not in str(stated.value)
    assert not any(tmp_path.iterdir())


def test_one_fmu_by_its_name_goes_to_a_folder_by_its_name(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert fmus.build_fmus("vessel", "out") == [Path("out", "vessel.fmu")]
    assert [path.name for path in Path("out").iterdir()] == ["vessel.fmu"]


def described(folder, seed):
    """A finished run with this seed in a folder; its description."""
    stated = {"scenario": {"name": "x", "seed": seed}, "fmus": {"vessel": {"sha256": "1", "path": "p"}}}
    if folder is not None:
        folder.mkdir(parents=True)
        (folder / "log.json").write_text(json.dumps(stated))
    return stated


def test_the_default_folder_is_not_that_of_another_run(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    first, second, third = (described(None, seed) for seed in (1, 2, 3))
    assert default_folder("x", first) == Path("results/x")
    described(Path("results/x"), 1)
    described(Path("results/x_2"), 2)
    assert default_folder("x", first) == Path("results/x")
    assert default_folder("x", second) == Path("results/x_2")
    assert default_folder("x", third) == Path("results/x_3")
    assert default_folder("x", third, overwrite=True) == Path("results/x")
    other = first | {"fmus": {"vessel": {"sha256": "2", "path": "p"}}}
    assert default_folder("x", other) == Path("results/x_3")
    Path("results/x_3").mkdir()
    Path("results/x_3/log.json").write_text("not ours")
    assert default_folder("x", third) == Path("results/x_4")
    Path("results/x_4").write_text("a file")
    assert default_folder("x", third) == Path("results/x_5")


def test_a_file_in_place_of_the_folder_of_results_ends_the_search(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("results").write_text("")
    assert default_folder("x", {}) == Path("results/x")


@pytest.mark.parametrize("given", [{"stop": 0.1}, {"set": {"stop": 0.1}}])
def test_a_run_that_is_cut_short_by_either_option_has_metrics(given, tmp_path):
    assert "e_pos_rms" in cosim.simulate("ellipse", tmp_path, **given).metrics


def test_a_run_that_is_refused_has_no_note_on_its_folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    described(Path("results/ellipse"), 1)
    heard = []
    with monkeypatch.context() as patch:
        patch.setattr(simulation, "find_spec", lambda name: None)
        with pytest.raises(cosim.InputError, match="needs pyarrow"):
            cosim.simulate("ellipse", set=SHORT | {"log.format": "parquet"}, show=heard.append)
    assert not any("another run" in note for note in heard)
    assert not Path("results/ellipse_2").exists()
    cosim.simulate("ellipse", set=SHORT, show=heard.append)
    stated = f"note: another run is in '{Path('results/ellipse')}'; this one is written to"
    assert f"{stated} '{Path('results/ellipse_2')}'" in heard


def test_a_diagnosis_that_is_refused_has_no_note_on_its_folder(tmp_path, capsys):
    usual = tmp_path / "diagnosis"
    usual.mkdir()
    (usual / "diagnosis.json").write_text("{}")

    def refuse(options, advance):
        raise cosim.InputError("no such run")

    for work, code in ((refuse, 2), (lambda options, advance: command_line.Done(0, []), 0)):
        options = SimpleNamespace(out=None, usual=usual, overwrite=False)
        assert command_line.run(work, options) == code
        assert ("another result is in" in capsys.readouterr().err) == (code == 0)


def test_runs_in_threads_wait_for_each_other(tmp_path):
    found = {}

    def make(seed):
        found[seed] = cosim.simulate("ellipse", tmp_path / str(seed), seed=seed, set=SHORT).metrics

    threads = [threading.Thread(target=make, args=(seed,)) for seed in (1, 2)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert {} != found[1] != found[2] != {}


def test_a_run_inside_of_a_run_is_refused(tmp_path):
    def nested(_):
        cosim.simulate("ellipse", tmp_path / "inner", set=SHORT)

    with pytest.raises(cosim.InputError, match="use processes"):
        cosim.simulate("ellipse", tmp_path / "outer", set=SHORT, progress=nested)


def test_a_plain_script_is_not_run_again_by_its_processes(tmp_path):
    script = tmp_path / "script.py"
    script.write_text(
        "print('once')\n"
        "from concurrent.futures import ProcessPoolExecutor\n"
        "from multiprocessing import get_context\n"
        "from operator import neg\n"
        "from cosim.process.spawned import without_program\n"
        "with without_program(), ProcessPoolExecutor(1, get_context('spawn')) as pool:\n"
        "    print(pool.submit(neg, 3).result())\n"
    )
    done = subprocess.run([sys.executable, script], capture_output=True, text=True, cwd=ROOT, check=False,
                          env={"PYTHONPATH": str(ROOT)})  # fmt: skip
    assert (done.stdout.split(), done.stderr) == (["once", "-3"], "")


def test_a_compact_log_has_what_metrics_pictures_and_the_diagnosis_read(ellipse, tmp_path):
    scenario = tmp_path / "scenario.json"
    scenario.write_text(json.dumps(ellipse))
    for name in ("all", "compact"):
        out = tmp_path / name
        assert run.main([str(scenario), "--out", str(out), "--log", name, "--quiet", "--no-plots"]) == 0
    full, compact = tmp_path / "all", tmp_path / "compact"
    there = cosim.read_log(full).keys() & Roles().columns
    assert there == cosim.read_log(compact).keys() & Roles().columns
    assert (full / "metrics.json").read_bytes() == (compact / "metrics.json").read_bytes()
    assert (compact / "log.csv").stat().st_size < 0.35 * (full / "log.csv").stat().st_size
    a, b = diagnosis.read(full), diagnosis.read(compact)
    assert (a.pose == b.pose).all()
    assert (a.tau_cmd == b.tau_cmd).all()


def model_file(path, **values):
    given = {name: cosim.Parameter(value) for name, value in values.items()}
    cosim.write_parameters(path, cosim.ParameterSet({"vessel": given}))
    return path


@pytest.mark.parametrize("observer", ["observer_luenberger.fmu", "observer_mdf.fmu"])
def test_beliefs_are_the_learned_model(ellipse, tmp_path, observer):
    ellipse["fmus"]["observer"] = {"path": observer}
    file = model_file(tmp_path / "model.ssv", delta_X_u=-2.0, Y_r=-6.0, V_n=0.1)
    system = prepare(load_scenario(ellipse), controller_models=[(file, cosim.read_parameters(file))])
    stated = {name: {v.name: x for v, x in values} for name, values in system.parameters.items()}
    controller = stated["controller"]
    assert controller["X_u"] == pytest.approx(-2.6555)  # the nominal value and the addition
    assert controller["phi_0_2"] == -6.0  # where adaptation of Y_r starts
    assert controller["phi_0_6"] == -1.9  # N_r, of which the file says nothing: nominal
    assert ("X_u" in stated["observer"]) == (observer == "observer_luenberger.fmu")
    assert stated["vessel"] == ellipse["fmus"]["vessel"].get(
        "parameters", {}
    )  # the plant is what it was
    assert any(
        "no controller and no observer of the scenario uses vessel.V_n" in w for w in system.warnings
    )
    system.close()


def test_a_belief_that_nobody_can_have_is_refused(ellipse, tmp_path, chain):
    file = model_file(tmp_path / "model.ssv", delta_X_u=-2.0)
    with pytest.raises(cosim.InputError, match="'vessel', which is not in the scenario"):
        cosim.simulate(chain, tmp_path / "out", controller_model=[file])
    del ellipse["fmus"]["controller"], ellipse["fmus"]["observer"]
    ellipse |= {"connections": [], "faults": [], "events": []}
    with pytest.raises(
        cosim.InputError,
        match="no controller and no observer of the scenario has parameters of the model vessel",
    ):
        cosim.simulate(ellipse, tmp_path / "out", controller_model=[file])


def test_every_command_of_cybership_is_a_module_and_told():
    assert {"pca", "pls", "replay", "sysid", "watch"} < all_modules().keys(), "pip install -e . again"
    for name, module in all_modules().items():
        assert importlib.util.find_spec(module) is not None, name
        assert re.search(rf"^  {name} +{re.escape(purpose(name, module))}$", usage(), re.MULTILINE)


def test_a_package_adds_commands_and_replaces_none(monkeypatch):
    points = [EntryPoint(n, m, GROUP) for n, m in (("mine", "no.such.module"), ("run", "no.run"))]
    monkeypatch.setattr(subcommands, "entry_points", lambda group: points)
    assert all_modules() == {n: c.module for n, c in SUBCOMMANDS.items()} | {"mine": "no.such.module"}
    assert "\n  mine       cannot be run: no.such.module: " in usage()


def test_cybership_names_the_nearest_command_and_imports_little(capsys, monkeypatch):
    monkeypatch.setattr(sys, "argv", ["cybership", "lern"])
    assert main() == 2
    assert "did you mean 'learn'" in capsys.readouterr().err
    code = "import sys; sys.argv = ['cybership']; from cybership.__main__ import main; main(); "
    code += "print(*{'numpy', 'rich', 'pydantic', 'fmpy'} & set(sys.modules))"
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, cwd=ROOT, check=True
    )
    assert done.stdout.endswith("\n\n")


def test_usage_lines_name_the_command_that_was_called(monkeypatch):
    monkeypatch.setattr(sys, "argv", ["cosim/run.py", "--help"])
    assert command.program("cosim.run") == "python -m cosim.run"
    monkeypatch.setattr(sys, "argv", ["cybership run", "--help"])
    assert command.program("cosim.run") == "cybership run"
    done = subprocess.run(
        [sys.executable, "-m", "cybership", "metrics", "--help"],
        capture_output=True, text=True, cwd=ROOT, check=True,
    )  # fmt: skip
    assert done.stdout.startswith("usage: cybership metrics [-h]")
    assert "\n  cybership metrics results/ellipse --json\n" in done.stdout


@pytest.mark.skipif(shutil.which("bash") is None, reason="no bash")
def test_bash_completes_commands_options_values_scenarios_and_files(tmp_path, capsys):
    """The printed function, in bash, with a command that only has a usage line."""
    (tmp_path / "my run.json").write_text("{}")
    assert completion.main(["bash"]) == 0
    script = capsys.readouterr().out + (
        "cybership() { printf 'usage: cybership run [--log {all,compact}] [--no-plots]\\n'; "
        "printf '\\nexamples: cybership plots --width 3\\n'; }\n"
        'tried() { COMP_WORDS=("$@"); COMP_CWORD=$(($# - 1)); COMPREPLY=(); _cybership; '
        "(IFS='|'; echo \"${COMPREPLY[*]}\"); }\n"
        "tried cybership cam; tried cybership run --; tried cybership run --log c; "
        "tried cybership run guid; tried cybership run my; tried cybership run --out guid\n"
    )
    done = subprocess.run(
        ["bash", "-c", script], capture_output=True, text=True, cwd=tmp_path, check=True
    )
    expected = ["campaign", "--log|--no-plots", "compact", "guidance_fault", "my run.json", ""]
    assert (done.stdout.splitlines(), done.stderr) == (expected, "")


@pytest.mark.parametrize(
    ("arguments", "code", "stated"),
    [
        (["--help"], 0, "cybership completion fish | source"),
        (["bsh"], 2, "invalid choice: 'bsh'"),
        ([], 2, "required: shell"),
    ],
)
def test_completion_has_help_and_names_its_shells(arguments, code, stated, capsys):
    with pytest.raises(SystemExit) as ended:
        completion.main(arguments)
    assert ended.value.code == code
    shown = capsys.readouterr()
    assert stated in (shown.err if code else shown.out)
    assert "``" not in shown.err + shown.out


def test_a_missing_library_is_told_with_its_extra():
    message = missing_extra(ModuleNotFoundError("No module named 'sklearn'", name="sklearn.cross"))
    assert message == "this needs sklearn: pip install 'cybership[analysis]'"
    assert missing_extra(ModuleNotFoundError("No module named 'mine'", name="mine")) is None


@pytest.mark.parametrize("command", [["diagnosis.learn"], ["thesis.pca"], ["cybership", "learn"]])
def test_a_command_that_cannot_be_imported_ends_in_one_line(command, tmp_path):
    absent = "raise ModuleNotFoundError(\"No module named 'scipy'\", name='scipy')"
    (tmp_path / "scipy.py").write_text(absent)
    places = os.pathsep.join([str(tmp_path), str(ROOT)])
    done = subprocess.run(
        [sys.executable, "-m", *command, "nowhere.csv"], capture_output=True, text=True, check=False,
        env=os.environ | {"PYTHONPATH": places},
    )  # fmt: skip
    assert done.stderr == "error: this needs scipy: pip install 'cybership[diagnosis]'\n"
    assert done.returncode == 2


def test_shipped_scenarios_come_by_name(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "eight").mkdir()  # a folder of results is no scenario
    assert load_scenario("eight").name == "eight"
    assert {"ellipse", "eight", "setpoint"} <= {*cosim.shipped_names()}
    with pytest.raises(cosim.InputError, match="did you mean 'ellipse'"):
        load_scenario("elipse.json")


def test_a_diagnosis_is_not_laid_over_that_of_other_inputs(tmp_path):
    (tmp_path / "a").mkdir()
    (tmp_path / "a" / "log.csv").write_text("time\n")
    usual, hashed = tmp_path / "diagnosis", result_folder.sha256(tmp_path / "a")
    assert hashed == result_folder.sha256(tmp_path / "a" / "log.csv") != ""
    inputs = {"a": hashed}
    assert result_folder.default_folder(usual, inputs) == usual
    usual.mkdir()
    assert result_folder.default_folder(usual, inputs) == usual  # empty
    (usual / "diagnosis.json").write_text("{}")
    second = tmp_path / "diagnosis_2"
    assert result_folder.default_folder(usual, inputs) == second  # of unknown inputs
    assert result_folder.default_folder(usual, inputs, overwrite=True) == usual
    result_folder.keep_inputs(usual, inputs)
    assert result_folder.default_folder(usual, inputs) == usual
    assert result_folder.default_folder(usual, {"b": "other"}) == second


def test_pictures_have_the_format_and_size_that_is_asked_for(tmp_path):
    line = np.linspace(0.0, 1.0, 5)
    log = {"time": line, "vessel.x": line, "vessel.y": line, "vessel.psi": 0.0 * line}
    for width in (4.0, 8.0):
        look = PictureOptions("svg", width=width, style="ggplot")
        assert [p.name for p in draw({"a": log}, tmp_path, options=look)] == ["trajectory.svg"]
        svg = (tmp_path / "trajectory.svg").read_text()
        assert float(re.search(r'width="([\d.]+)pt"', svg)[1]) == pytest.approx(72.0 * width)
    with pytest.raises(cosim.InputError, match="no style 'gplot'; did you mean 'ggplot'"):
        draw({"a": log}, tmp_path / "new", options=PictureOptions(style="gplot"))
    assert not (tmp_path / "new").exists()


def test_what_two_findings_explain_alike_is_neithers_own(monkeypatch):
    """Here a model is the size of the error that it leaves, and no coefficient moves."""
    monkeypatch.setattr(shares, "omega", lambda w, model: np.full((4, 3), model.error))
    left = {"a": 0.9, "b": 0.1}  # without it, all else fitted anew; 0.1 with both
    fitted = SimpleNamespace(search=SimpleNamespace(by="regression"))

    def model(error):
        return SimpleNamespace(error=error, ship=SimpleNamespace(effects={"a": fitted, "b": fitted}))

    def keep(ids):
        (gone,) = left.keys() - set(ids)
        return SimpleNamespace(effects=ids, model=model(left[gone]), plausible=True)

    found = SimpleNamespace(
        effects=[SimpleNamespace(id="a", of_runs=[]), SimpleNamespace(id="b", of_runs=[])],
        model=model(0.1), sigma=np.ones(3), refit=keep,
    )  # fmt: skip
    assert shares.unique_shares(found, model(1.0), [None], []) == pytest.approx([0.8, 0.0])


@pytest.mark.parametrize(
    "name",
    [
        n
        for n, module in all_modules().items()
        if module.startswith(("cosim.", "diagnosis.", "thesis.")) and n != "schema"
    ],
)
def test_help_of_a_command_tells_what_each_argument_is(name, monkeypatch):
    module = importlib.import_module(all_modules()[name])
    if not hasattr(module, "main"):
        module = importlib.import_module(f"{module.__name__}.__main__")

    def parse(parser, *_):
        assert [a.dest for a in parser._actions if not a.help] == []
        raise SystemExit(0)

    monkeypatch.setattr(argparse.ArgumentParser, "parse_args", parse)
    with pytest.raises(SystemExit):
        module.main([])
