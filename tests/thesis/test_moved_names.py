"""Names that moved to the thesis work for one release, and say so."""

import subprocess
import sys

import pytest
from support.project import ROOT


@pytest.mark.parametrize(
    ("old", "new"), [("diagnosis.pca", "thesis.pca"), ("studies.chapter5", "thesis.chapter5")]
)
def test_old_paths_of_moved_commands_run_and_say_so(old, new):
    done = subprocess.run(
        [sys.executable, "-m", old, "--help"], capture_output=True, text=True, cwd=ROOT, check=True
    )
    assert done.stdout.startswith(f"usage: python -m {new} ")
    assert done.stderr == f"note: {old} is now {new}; the old name goes with the next release\n"


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
        "note: diagnosis.analysis is now thesis.analysis; the old name goes with the next release\n"
    )
