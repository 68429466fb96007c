"""Run one trial on one unpacked FMU: ``python -m fmucheck.child RULE FOLDER LIBRARY REPORT NOTE``.

Started by ``trial``, in a process of its own, since an FMU may crash, hang, or be good for only one
instance. What was found goes to the file REPORT, the name of the function under way to the file NOTE.
"""

import json
import os
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import NoReturn
from xml.etree import ElementTree

from .api import Library, StatusError
from .description import FmuDescription
from .fmu_on_trial import FmuOnTrial
from .registry import RULES, NotApplicableError


def _run(rule: str, folder: Path, library: str, note: Path) -> dict[str, object]:
    from . import rules  # noqa: F401  # registers them

    with note.open("wb", buffering=0) as file:

        def write(name: str) -> None:
            file.seek(0)
            file.write(name.encode().ljust(64))

        description = FmuDescription(ElementTree.parse(folder / "modelDescription.xml").getroot())
        found: list[str] = []
        try:
            fmu = FmuOnTrial(description, folder, Library(folder / library, write))
            for text in RULES[rule].check(fmu):
                found.append(text)
        except NotApplicableError as reason:
            return {"found": found, "skipped": str(reason)}
        except StatusError as refused:
            found.append(str(refused))
        except OSError as error:
            stated = f"the library cannot be loaded: {error}"
            if description.has("needsExecutionTool"):
                return {"skipped": f"needsExecutionTool is declared, and {stated}"}
            found.append(stated)
        except Exception as error:
            found.append(f"internal error of the check: {error!r}; please report it")
        return {"found": found}


def main(arguments: Sequence[str]) -> NoReturn:
    """Write the report, then leave without tidying up: that an FMU cannot upset."""
    rule, folder, library, report, note = arguments
    result = _run(rule, Path(folder), library, Path(note))
    part = Path(f"{report}.part")
    part.write_text(json.dumps(result))
    part.replace(report)
    os._exit(0)


if __name__ == "__main__":
    main(sys.argv[1:])
