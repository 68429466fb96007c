"""What tools from the package index find."""

import logging
import sys
import threading
from collections.abc import Iterator
from logging.handlers import BufferingHandler
from pathlib import Path
from xml.etree.ElementTree import tostring

from ..fmu import FmuArchive
from ..registry import NotInstalledError, rule


@rule("2.2")
def xsd(fmu: FmuArchive) -> Iterator[str]:
    """The description is valid against the XML schema of FMI 2.0 (as FMPy ships it)."""
    try:
        import fmpy
        from lxml import etree  # pyright: ignore[reportAttributeAccessIssue]  # made by C
    except ImportError:
        raise NotInstalledError("fmpy") from None
    schema = etree.XMLSchema(
        etree.parse(str(Path(fmpy.__file__).parent / "schema" / "fmi2" / "fmi2ModelDescription.xsd"))
    )
    schema.validate(etree.fromstring(tostring(fmu.description.root)))
    for error in schema.error_log:
        yield error.message


@rule("2.2")
def fmpy(fmu: FmuArchive) -> Iterator[str]:
    """FMPy's validate_fmu reports no error."""
    try:
        from fmpy.validation import validate_fmu
    except ImportError:
        raise NotInstalledError("fmpy") from None
    for problem in validate_fmu(str(fmu.path)):
        yield " ".join(str(problem).split())


@rule("2.2")
def fmutool(fmu: FmuArchive) -> Iterator[str]:
    """The checkers of the FMU Manipulation Toolbox report no error."""
    try:
        from fmu_manipulation_toolbox.checker import get_checkers
        from fmu_manipulation_toolbox.operations import FMU
    except ImportError:
        raise NotInstalledError("fmu-manipulation-toolbox") from None
    heard, here = BufferingHandler(sys.maxsize), threading.get_ident()
    heard.setLevel(logging.ERROR)
    heard.addFilter(lambda record: record.thread == here)  # others check other FMUs at the same time
    logger = logging.getLogger("fmu_manipulation_toolbox")
    if not logger.isEnabledFor(logging.ERROR):  # somebody has silenced the toolbox
        logger.setLevel(logging.ERROR)
    logger.addHandler(heard)
    try:
        opened = FMU(str(fmu.path))
        for checker in get_checkers():
            opened.apply_operation(checker())
    except Exception as error:
        yield f"it fails: {error!r}"
    finally:
        logger.removeHandler(heard)
    yield from (" ".join(record.getMessage().split()) for record in heard.buffer)
