"""Names that moved to the thesis work for one release, and say so."""

import subprocess
import sys

import pytest
from support.project import ROOT


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("diagnosis.pca", "thesis.pca"),
        pytest.param("studies.chapter5", "thesis.chapter5", marks=pytest.mark.slow),
    ],
)
def test_old_paths_of_moved_commands_run_and_say_so(old, new):
    done = subprocess.run(
        [sys.executable, "-m", old, "--help"], capture_output=True, text=True, cwd=ROOT, check=True
    )
    assert done.stdout.startswith(f"usage: python -m {new} ")
    assert done.stderr == f"note: {old} has the new name {new}; the next release removes the old name\n"


@pytest.mark.slow
def test_an_old_name_is_the_module_itself():
    """In a process of its own, where no other test has used the old name."""
    code = """if True:
        import diagnosis.analysis.samples, thesis.analysis.samples
        assert diagnosis.analysis.samples is thesis.analysis.samples
        assert thesis.analysis.samples.__spec__.name == "thesis.analysis.samples"
    """
    done = subprocess.run(
        [sys.executable, "-W", "error::ImportWarning", "-c", code],
        capture_output=True, text=True, cwd=ROOT, check=True,
    )  # fmt: skip
    assert done.stderr == (
        "note: diagnosis.analysis has the new name thesis.analysis; the next release removes the old name\n"
    )
