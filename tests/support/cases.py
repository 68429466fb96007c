"""Cases of one test, of which the quick part runs some."""

from collections.abc import Iterable, Sequence

import pytest


def in_part(cases: Iterable[object], keep: Sequence[object]) -> list[object]:
    """All cases for ``parametrize``, those that are not kept for the quick part marked slow."""
    cases = list(cases)
    assert all(case in cases for case in keep)
    return [case if case in keep else slow(case) for case in cases]


def slow(case: object) -> object:
    """A case, a tuple where the test has several arguments, that the quick part leaves out."""
    values = case if isinstance(case, tuple) else (case,)
    return pytest.param(*values, marks=pytest.mark.slow)
