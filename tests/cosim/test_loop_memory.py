"""Memory that other code uses by its address: it lives, and is large enough."""

import ctypes
from types import SimpleNamespace

import pytest

from cosim.master.loops.layout import _transfers_layout
from cosim.process.run_state import ROWS, RunState


def test_all_that_c_has_addresses_of_is_kept():
    values = (ctypes.c_double * 2)(3.0, 4.0)
    transfers = [
        SimpleNamespace(
            function=1, references=(ctypes.c_uint * n)(), address=ctypes.addressof(values), slots=slots
        )
        for n, slots in ((2, None), (1, [5]))
    ]
    kept = ["before"]
    layout = _transfers_layout(transfers, kept)
    assert kept[0] == "before"
    for needed in (layout, *transfers):
        assert any(each is needed for each in kept)
    (slots,) = [each for each in kept if getattr(each, "typecode", "") == "q"]
    assert layout[1].slots == slots.buffer_info()[0]
    assert layout[0].slots is None
    assert [place.count for place in layout] == [2, 1]


@pytest.mark.parametrize(
    ("seen", "more", "common"), [(True, 0, True), (True, 1, False), (False, 0, False)]
)
def test_rows_have_memory_whoever_watches_and_however_many_they_are(seen, more, common):
    state = RunState()
    state.watched = seen
    needed = ROWS[1] + more
    memory, numbers = state.pending(needed)
    assert len(memory) >= needed
    memory[needed - 1] = 7
    numbers[15] = 1
    assert (state._octets[ROWS[0] + ROWS[1] - 1] == 7) == common
    assert (numbers is state.numbers) == common
