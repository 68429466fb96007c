"""What the description says of the FMU as a whole (2.2.1, 2.2.4 to 2.2.6, 4.3.1)."""

import math
import re
from collections import Counter
from collections.abc import Iterable, Iterator

from ..description import number, whole
from ..fmu import FmuArchive
from ..registry import rule

_DATE = re.compile(r"\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d(\.\d+)?Z")


def twice(names: Iterable[str | None]) -> list[str]:
    """What occurs more than once, sorted."""
    return sorted(str(name) for name, times in Counter(names).items() if times > 1)


@rule("2.2")
def encoding(fmu: FmuArchive) -> Iterator[str]:
    """The description is encoded in UTF-8."""
    if fmu.encoding.upper() != "UTF-8":
        yield f"modelDescription.xml is in {fmu.encoding}"


@rule("2.2.1")
def header(fmu: FmuArchive) -> Iterator[str]:
    """guid and modelName exist, and the date of generation has the form YYYY-MM-DDThh:mm:ssZ."""
    root = fmu.description.root
    for attribute in ("guid", "modelName"):
        if not (root.get(attribute) or "").strip():
            yield f"{attribute} is missing or empty"
    date = root.get("generationDateAndTime")
    if date is not None and not _DATE.fullmatch(date):
        yield f"generationDateAndTime is '{date}'"
    convention = root.get("variableNamingConvention", "flat")
    if convention not in ("flat", "structured"):
        yield f"variableNamingConvention is '{convention}'"


@rule("4.3.1")
def capabilities(fmu: FmuArchive) -> Iterator[str]:
    """modelIdentifier is a C name, and the capabilities do not contradict each other."""
    description = fmu.description
    identifier = description.cs.get("modelIdentifier", "")
    if not re.fullmatch(r"[A-Za-z_]\w*", identifier, re.ASCII):
        yield f"modelIdentifier '{identifier}' is not a valid name in C"
    if description.has("canSerializeFMUstate") and not description.has("canGetAndSetFMUstate"):
        yield "canSerializeFMUstate without canGetAndSetFMUstate: there is no state to serialise"
    order = whole(description.cs.get("maxOutputDerivativeOrder", "0"))
    if order is None or order < 0:
        yield f"maxOutputDerivativeOrder is '{description.cs['maxOutputDerivativeOrder']}'"
    files = [f.get("name") for f in description.root.iterfind("CoSimulation/SourceFiles/File")]
    for name in twice(files):
        yield f"source file '{name}' is listed twice"
    there = {member.filename for member in fmu.members}
    for name in files:
        if f"sources/{name}" not in there:
            yield f"source file '{name}' is not in the archive"


@rule("2.2.4")
def log_categories(fmu: FmuArchive) -> Iterator[str]:
    """Log categories have unique names."""
    names = [c.get("name") for c in fmu.description.root.iterfind("LogCategories/Category")]
    for name in twice(names):
        yield f"category '{name}' is defined twice"
    if not all(names):
        yield "a category without a name"


@rule("2.2.5")
def experiment(fmu: FmuArchive) -> Iterator[str]:
    """The default experiment has finite values, ends after its start, and is not shorter than its
    positive step size.
    """
    given = fmu.description.experiment
    values = {name: number(text) for name, text in given.items()}
    for name, value in values.items():
        if value is None or not math.isfinite(value):
            yield f"{name} is '{given[name]}'"
            return
    start, stop = values.get("startTime") or 0.0, values.get("stopTime")
    step, tolerance = values.get("stepSize"), values.get("tolerance")
    if stop is not None and stop <= start:
        yield f"it stops at {stop:g} s, but starts at {start:g} s"
    elif stop is not None and step is not None and step > stop - start:
        yield f"one step of {step:g} s is longer than the whole experiment"
    if step is not None and step <= 0.0:
        yield f"stepSize is {step:g} s"
    if tolerance is not None and tolerance <= 0.0:
        yield f"tolerance is {tolerance:g}"


@rule("2.2.6")
def annotations(fmu: FmuArchive) -> Iterator[str]:
    """Each tool has one entry among the vendor annotations."""
    root = fmu.description.root
    for name in twice(t.get("name") for t in root.iterfind("VendorAnnotations/Tool")):
        yield f"tool '{name}' has two entries"
    for v in root.iterfind("ModelVariables/ScalarVariable"):
        for name in twice(t.get("name") for t in v.iterfind("Annotations/Tool")):
            yield f"tool '{name}' has two entries at {v.get('name')}"
