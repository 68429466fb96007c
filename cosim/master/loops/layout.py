"""Memory as the compiled step loop reads it: the structures of cosim/compiled/loop.c."""

from __future__ import annotations

import ctypes
from array import array
from collections.abc import Sequence
from ctypes import POINTER, c_double, c_int64, c_void_p
from typing import Any

from ...fmu.instance import DirectTransfer
from ...scenario.operations import Operation
from ..stepper import Stepper


class OperationLayout(ctypes.Structure):
    _fields_ = (
        ("code", c_int64),
        ("count", c_int64),
        ("slots", c_void_p),
        ("acts", c_void_p),
        ("numbers", c_void_p),
        ("stride", c_int64),
        ("cursor", c_void_p),
        ("samples", c_int64),
        ("memory", c_void_p),
        ("calls", c_void_p),
        ("sources", c_void_p),
    )


class CopyLayout(ctypes.Structure):
    _fields_ = (
        ("target", c_int64),
        ("source", c_int64),
        ("count", c_int64),
    )


class TransferLayout(ctypes.Structure):
    _fields_ = (
        ("function", c_void_p),
        ("references", c_void_p),
        ("count", c_int64),
        ("values", c_void_p),
        ("slots", c_void_p),
    )


class FmuLayout(ctypes.Structure):
    _fields_ = (
        ("component", c_void_p),
        ("number", c_int64),
        ("every", c_int64),
        ("h", c_double),
        ("do_step", c_void_p),
        ("save", c_void_p),
        ("state", c_void_p),
        ("copies", c_int64),
        ("inputs", c_int64),
        ("outputs", c_int64),
        ("sets", c_int64),
        ("gets", c_int64),
        ("copied", POINTER(CopyLayout)),
        ("on_inputs", POINTER(OperationLayout)),
        ("on_outputs", POINTER(OperationLayout)),
        ("set", POINTER(TransferLayout)),
        ("get", POINTER(TransferLayout)),
    )


class LoopLayout(ctypes.Structure):
    _fields_ = (
        ("table", c_void_p),
        ("width", c_int64),
        ("fmus", c_int64),
        ("jacobi", c_int64),
        ("fmu", POINTER(FmuLayout)),
        ("times", c_void_p),
        ("first", c_int64),
        ("instants", c_void_p),
        ("rows", c_void_p),
        ("finite", c_void_p),
        ("called", c_void_p),
        ("taken", c_void_p),
        ("room", c_int64),
        ("patience", c_double),
        ("step", c_int64),
        ("index", c_int64),
        ("status", c_int64),
        ("saved", c_int64),
    )


STRUCTURES = (OperationLayout, CopyLayout, TransferLayout, FmuLayout, LoopLayout)


def address(numbers: array[Any]) -> int:
    """Address of the numbers of an array, for as long as it keeps its length."""
    return numbers.buffer_info()[0]


def operations_layout(operations: Sequence[Operation], kept: list[Any]) -> ctypes.Array[OperationLayout]:
    """Operations as C reads them, until they plan ahead the next time.

    Args:
        operations: in their order.
        kept: receives what must live as long as the result.
    """
    layout = (OperationLayout * len(operations))()
    for place, operation in zip(layout, operations, strict=True):
        slots, sources = array("q", operation.slots), array("q", operation.sources)
        kept += [slots, sources, operation]
        is_planned = operation.plan is not None
        place.code, place.count, place.slots = operation.code, len(slots), address(slots)
        place.acts = address(operation.acts) if is_planned else None
        place.numbers, place.stride = address(operation.numbers), operation.width * is_planned
        place.cursor, place.samples = address(operation.cursor), operation.samples
        place.memory, place.calls = address(operation.memory), address(operation.calls)
        place.sources = address(sources)
    kept.append(layout)
    return layout


def _transfers_layout(
    transfers: Sequence[DirectTransfer], kept: list[Any]
) -> ctypes.Array[TransferLayout]:
    layout = (TransferLayout * len(transfers))()
    for place, transfer in zip(layout, transfers, strict=True):
        place.function, place.count = transfer.function, len(transfer.references)
        place.references, place.values = ctypes.addressof(transfer.references), transfer.address
        if transfer.slots is not None:
            slots = array("q", transfer.slots)
            kept.append(slots)
            place.slots = address(slots)
    kept += [layout, *transfers]
    return layout


def lay_out_fmu(place: FmuLayout, stepper: Stepper, kept: list[Any]) -> None:
    """An FMU as C reads it, but for what acts on its values.

    Args:
        place: to fill.
        stepper: the FMU; its calls are direct.
        kept: receives what must live as long as ``place`` is used.
    """
    direct = stepper.access.direct
    assert direct is not None
    place.component, place.number = direct.pointer, stepper.number
    place.every, place.h = stepper.every, stepper.step_size
    place.do_step, place.save, place.state = direct.do_step, direct.save, direct.state
    copied = (CopyLayout * len(stepper.copies))(*stepper.copies)
    sets, gets = _transfers_layout(direct.sets, kept), _transfers_layout(direct.gets, kept)
    place.copies, place.copied = len(copied), copied
    place.sets, place.set = len(sets), sets
    place.gets, place.get = len(gets), gets
    kept += [copied, direct]
