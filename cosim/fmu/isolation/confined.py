"""An FMU whose instances run in confined processes: without the user's files, environment and arguments.

Each instance has a process of its own that knows nothing of another one, and an empty folder. What
confines it (:mod:`cosim.fmu.isolation.confinement`) is stated in words, "unconfined" where nothing does.
"""

import json
import os
import shutil
import socket
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import suppress
from pathlib import Path

from cybership.message_text import printable
from cybership.scratch_folder import Scratch

from ...errors import SimulationError
from ..fmu_model import FmuModel
from .confinement import MEANS, available, needed_folders
from .isolated import EXIT_TIMEOUT, START_TIMEOUT, IsolatedInstance
from .opened_files import OpenedFiles
from .worker_process import ForkedProcess, Printed, StartedProcess

MOST_OPENED = 20  # files that are named; chosen: more say no more
FORKS = hasattr(os, "fork")
NAME = "model"  # of every instance, as another one would say which it is
# Variables of the environment that a process keeps; others may hold paths and secrets.
KEPT = ("PATH", "LANG", "LC_ALL", "LC_CTYPE", "LD_LIBRARY_PATH", "TZ")


class ConfinedFmu:
    """An FMU, and the process that makes those of its instances.

    Args:
        model: the FMU.
        means: what may confine it, of ``MEANS``; none: nothing does.
        timeout: longest wall time of a call [s]; None: by what a step usually takes.

    Attributes:
        confinement: what is in force, in words.
        printed: what instances have printed, each line once.
        outside: files beyond programs and libraries that instances have opened or tried to, each once;
            empty where the system cannot say.

    Raises:
        InputError: the archive cannot be unpacked.
        SimulationError: no process can be started.
    """

    def __init__(
        self, model: FmuModel, means: Sequence[str] = MEANS, timeout: float | None = None
    ) -> None:
        self.model, self.timeout = model, timeout
        self.printed: dict[str, None] = {}
        self.outside: dict[str, None] = {}
        self._owner, self._closed = os.getpid(), False
        self._scratch = Scratch()
        self._archive = self._scratch.path / model.path.name
        self._folders = self._scratch.path / "folders"
        self._folders.mkdir()
        shutil.copyfile(model.path, self._archive)
        self._model = model.copied_to(self._archive)
        try:
            self._unpacked = str(self._model.unpack())
            self._readable = [*needed_folders(), self._unpacked]
            self.confinement = self._begun(means) if FORKS else available((), lambda _: "").text
        except OSError as error:
            self.close()
            raise SimulationError(f"{model.path.name}: no process for it: {error}") from None
        except BaseException:
            self.close()
            raise
        if not self.confinement:
            self.close()
            why = "; ".join(self.printed)
            raise SimulationError(f"{model.path.name}: the process for it has ended: {why}")

    def _begun(self, means: Sequence[str]) -> str:
        """Start what forks the processes; returns what confines them."""
        self._server, theirs = socket.socketpair()
        with theirs:
            self._process = subprocess.Popen(
                [sys.executable, "-m", "cosim.fmu.isolation.fork_server"],
                stdin=theirs.fileno(),
                stdout=subprocess.DEVNULL,
                stderr=subprocess.PIPE,
                cwd=self._folder(),
                env=_environment(),
                start_new_session=True,
            )
        assert self._process.stderr is not None
        self._complaints = Printed(self._process.stderr, self._keep)
        self._server.settimeout(START_TIMEOUT)
        first = [list(means), str(self._archive), self._unpacked, str(self._folder())]
        self._server.sendall(json.dumps(first).encode())
        return self._server.recv(4096).decode()

    def sentences(self) -> Iterator[str]:
        """What a reader should know of how instances have run so far."""
        if self.model.needs_tool:
            yield "It needs the tool that exported it (needsExecutionTool)."
        if lines := [*self.printed]:
            yield f"It printed {len(lines)} different lines, the first: {lines[0]}"
        yield f"Its processes: {self.confinement}."
        if outside := [*self.outside]:
            named = ", ".join(outside[:3]) + (", ..." if outside[3:] else "")
            yield f"It opened, or tried to open, {len(outside)} files outside of its own: {named}."

    def stated(self, error: Exception) -> str:
        """What an error says, with the file of the FMU in place of its copy."""
        return str(error).replace(str(self._archive), str(self.model.path))

    def instance(self) -> IsolatedInstance:
        """A new instance, in a process that has run nothing of the FMU.

        Raises:
            SimulationError: its process cannot be started.
        """
        if self._closed:
            raise SimulationError(f"{NAME}: its process cannot be started: it has been closed")
        return IsolatedInstance(NAME, self._model, _ignore, self.timeout, self._fork, self._keep)

    def _fork(self) -> ForkedProcess | StartedProcess:
        folder = self._folder()
        if not FORKS:
            return StartedProcess(folder, _environment())
        process = ForkedProcess(self._server, folder)
        OpenedFiles(process.opened, [*self._readable, str(self._folders)], self._note)
        return process

    def _note(self, path: str) -> None:
        if len(self.outside) < MOST_OPENED:
            self.outside.setdefault(printable(path))

    def _folder(self) -> Path:
        return Path(tempfile.mkdtemp(dir=self._folders))

    def _keep(self, line: str) -> None:
        self.printed.setdefault(line)

    def close(self) -> None:
        """End all processes, and remove their folders."""
        if os.getpid() != self._owner:  # a copy of the process that has begun them
            return
        self._closed = True
        with suppress(AttributeError):  # it has not begun
            self._server.close()
            with suppress(subprocess.TimeoutExpired):
                self._process.wait(EXIT_TIMEOUT)
            self._process.kill()
            self._process.wait()
            self._complaints.finish()
        self._model.close()
        self._scratch.remove()


def _ignore(*_: object) -> None:
    """Messages of an FMU that nobody reads."""


def _environment() -> dict[str, str]:
    """The environment of a process that is to know nothing of this one."""
    kept = {name: os.environ[name] for name in KEPT if name in os.environ}
    root = str(Path(__file__).resolve().parents[3])
    single = {"OPENBLAS_NUM_THREADS": "1", "PYTHONDONTWRITEBYTECODE": "1"}  # namespaces need one thread
    return kept | single | {"PYTHONPATH": root}
