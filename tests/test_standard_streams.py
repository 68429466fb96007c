"""Output that is closed, that nobody reads, or that a full disk refuses: the same for every command."""

import os
import shlex
import subprocess
import sys
from pathlib import Path

import pytest
from support.project import ROOT

pytestmark = pytest.mark.skipif(not Path("/dev/full").exists(), reason="not on Windows")

COMMANDS = [
    "cybership --help",
    "cybership completion bash",
    "cybership metrics --help",
    "cybership check --list",
    "cybership build --list",
    "cybership criteria",
    "fmus.effects",
    "cybership.completion bash",
]


def ended(command, redirected):
    """Exit code and standard error of a command in bash."""
    line = f"{shlex.quote(sys.executable)} -m {command} {redirected}; exit ${{PIPESTATUS[0]}}"
    environment = {k: v for k, v in os.environ.items() if k != "PYTHONUNBUFFERED"}
    done = subprocess.run(
        ["bash", "-c", line], stderr=subprocess.PIPE, text=True, cwd=ROOT, env=environment, check=False
    )
    return done.returncode, done.stderr


@pytest.mark.parametrize("command", COMMANDS)
def test_reader_that_leaves_is_no_error(command):
    assert ended(command, "| true") == (0, "")


@pytest.mark.parametrize("command", COMMANDS)
def test_full_disk_is_one_line(command):
    assert ended(command, ">/dev/full") == (3, "error: [Errno 28] No space left on device\n")


@pytest.mark.parametrize("command", COMMANDS[:5])
def test_closed_output_is_no_error(command):
    assert ended(command, ">&-") == (0, "")


def test_characters_that_the_terminal_lacks_are_question_marks(monkeypatch):
    monkeypatch.setenv("PYTHONIOENCODING", "ascii")
    assert ended("fmus.effects", ">/dev/null") == (0, "")


def test_help_of_a_command_by_its_name():
    texts = [
        subprocess.run(
            [sys.executable, "-m", "cybership", *words], cwd=ROOT, stdout=-1, check=True
        ).stdout
        for words in (["help", "metrics"], ["metrics", "--help"], ["help"])
    ]
    assert texts[0] == texts[1] != texts[2]


@pytest.mark.parametrize("closed", ["2>&-", ">&- 2>&-", "<&- >&- 2>&-"])
def test_closed_errors_leave_the_exit_code(closed):
    assert ended("cybership metrics nothere", closed) == (2, "")


def test_help_that_cannot_be_written_at_once_is_an_error():
    """Without a buffer, where argparse would hide it."""
    line = f"PYTHONUNBUFFERED=1 {shlex.quote(sys.executable)} -m cosim.metrics --help >/dev/full"
    assert subprocess.run(["bash", "-c", line], cwd=ROOT, check=False, stderr=-1).returncode == 3
