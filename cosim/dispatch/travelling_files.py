"""Files that travel to workers by the hash of their content: FMUs, and tables of parameters."""

import hashlib
from collections.abc import Sequence
from pathlib import Path, PurePath

from cybership.scratch_folder import atomic_write

from ..compiled.library import compiles
from ..errors import InputError
from ..fmu.fmu_model import FmuModel
from ..scenario.schema import Scenario
from ..system.own_fmus import read_models


class Files:
    """The FMUs and tables of a campaign, whose scenarios share a folder; each is read once.

    Attributes:
        paths: name by content, ``<sha256>.fmu`` or ``<sha256>.csv``, -> the file.
        resettable: SHA-256 of the FMUs that may be reset for another run: those that the project has
            built itself, whose instances hold all that they know.
        origins: SHA-256 -> how the scenario names it.
        fmus: name by content -> what has been read of the FMU.
        identities: name by content -> guid, of the FMUs that the project has built itself: of the same
            source in Python and compiled.
    """

    def __init__(self) -> None:
        self.paths: dict[str, Path] = {}
        self.resettable: set[str] = set()
        self.origins: dict[str, str] = {}
        self.fmus: dict[str, FmuModel] = {}
        self.identities: dict[str, str] = {}
        # By path, ship, and whether the project's own FMUs are compiled.
        self._models: dict[tuple[str, str | None, bool], FmuModel] = {}
        self._tables: dict[Path, str] = {}

    def read(self, scenarios: Sequence[Scenario]) -> list[str]:
        """Read the FMUs of scenarios of one folder that have not been read yet.

        Returns:
            Oddities that are no reason to refuse.

        Raises:
            InputError: no such FMU, or one that cannot be read.
        """
        notes: list[str] = []
        for kind in dict.fromkeys(map(_kind, scenarios)):
            alike = [s for s in scenarios if _kind(s) == kind]
            entries = {e.path: e for s in alike for e in s.fmus.values()}
            new = {path: e for path, e in entries.items() if (path, *kind) not in self._models}
            if new:
                found = read_models(alike[0].model_copy(update={"fmus": new}), notes)
                for path, model in found.items():
                    self._models[(path, *kind)] = model
                    self._add(path, model, alike[0].folder)
        return notes

    def _add(self, path: str, model: FmuModel, folder: Path) -> None:
        name = f"{model.sha256}.fmu"
        self.paths[name], self.fmus[name] = model.path, model
        self.origins[model.sha256] = path
        if PurePath(path).name == path and model.path.parent != folder:
            self.resettable.add(model.sha256)
            self.identities[name] = f"{model.name} {model.description.guid}"

    def models(self, scenario: Scenario) -> dict[str, FmuModel]:
        """The FMU of each instance; :meth:`read` has read them."""
        return {name: self._models[(e.path, *_kind(scenario))] for name, e in scenario.fmus.items()}

    def table(self, folder: Path, path: str) -> str:
        """The name by content of a table.

        Raises:
            InputError: it cannot be read.
        """
        file = folder / path
        if file not in self._tables:
            try:
                name = f"{hashlib.sha256(file.read_bytes()).hexdigest()}.csv"
            except OSError as error:
                raise InputError(f"'{file}' cannot be read: {error.strerror}") from None
            self._tables[file] = name
            self.paths[name] = file
        return self._tables[file]

    def close(self) -> None:
        """Remove what was unpacked."""
        for model in self._models.values():
            model.close()


def _kind(scenario: Scenario) -> tuple[str | None, bool]:
    """What else than its name decides which FMU is meant: the ship, and whether it is compiled."""
    return scenario.ship_source, compiles(scenario.native)


def put(folder: Path, name: str, content: bytes) -> None:
    """Put a file into a folder of files named by their contents, unless it is there.

    Raises:
        InputError: its content is not what its name says.
    """
    if (folder / name).is_file():
        return
    if hashlib.sha256(content).hexdigest() != PurePath(name).stem:
        raise InputError(f"'{name}' was changed during its transfer, or during the campaign")
    folder.mkdir(parents=True, exist_ok=True)
    with atomic_write(folder / name) as scratch:
        scratch.write_bytes(content)
