"""A command whose import fails: a library of an extra in one line, any other failure as Python shows it."""

import sys

import pytest

from cosim.command import BAD_INPUT, EXTRAS
from cosim.supervision import supervising


@pytest.fixture
def shown(monkeypatch):
    found = []
    monkeypatch.setattr(sys, "__excepthook__", lambda *error: found.append(error[1]))
    monkeypatch.setattr(supervising.STATE, "end", found.append)
    return found


def test_a_library_of_an_extra_is_named_with_what_installs_it(shown, capsys):
    library = next(iter(EXTRAS))
    error = ModuleNotFoundError(f"No module named '{library}.part'", name=f"{library}.part")
    with pytest.raises(SystemExit) as ended:
        supervising.end_without_extra(type(error), error, None)
    assert ended.value.code == BAD_INPUT
    assert shown == [BAD_INPUT], "the working process says how it ends"
    assert f"pip install 'cybership[{EXTRAS[library]}]'" in capsys.readouterr().err


@pytest.mark.parametrize(
    "error", [ModuleNotFoundError("other", name="other"), ValueError("x"), ImportError("y")]
)
def test_another_failure_is_not_hidden(shown, error):
    supervising.end_without_extra(type(error), error, None)
    assert shown == [error]
