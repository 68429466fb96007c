"""What forks the processes of one confined FMU: ``python -m cosim.fmu.isolation.fork_server``.

It has read the FMU and imported what its copies need, and never runs anything of the FMU itself, so
that a copy knows nothing of another one. A copy is three processes: one that the master can end, in new
namespaces the first one, which reports how the third one ended, and that third one, which runs the FMU.
"""

from __future__ import annotations

import json
import os
import signal
import socket
import sys
from contextlib import suppress
from pathlib import Path

from ...process.spawned import die_with_parent, end_with_parent
from ..fmu_model import FmuModel
from .confinement import (
    Confinement,
    available,
    enter_root,
    needed_folders,
    restrict,
    unshare,
)
from .opened_files import install
from .system_calls import refuse_sharing
from .worker import serve

MESSAGE = 2**16  # most bytes of a request; chosen: far above a few paths
PIPES = 5  # requests, answers, what is printed, how it ended, and a socket for its opened files


class _ForkServer:
    """Serves the requests of a master.

    Args:
        master: the connection.
        model: the FMU.
        readable: folders that copies may read.
    """

    def __init__(self, master: socket.socket, model: FmuModel, readable: list[str]) -> None:
        self._master, self._model, self._readable = master, model, readable
        self._found = Confinement("", "", 0)

    def serve(self, means: list[str], folder: str) -> None:
        """Say what confines the copies, then make one for each request until the master is gone."""

        def trial(found: Confinement) -> str:
            reader, writer = os.pipe()
            if not (child := os.fork()):
                self._found, why = found, ""
                try:
                    root = unshare(self._readable, folder)
                    if not (first := os.fork()):
                        enter_root(root)
                        restrict(found, self._readable, [folder])
                        os._exit(0)
                    why = "" if os.waitpid(first, 0)[1] == 0 else "no own tree of files"
                except OSError as error:
                    why = str(error.strerror)
                os.write(writer, why.encode())
                os._exit(0)
            os.close(writer)
            os.waitpid(child, 0)
            with os.fdopen(reader, "rb") as pipe:
                return pipe.read().decode()

        self._found = available(means, trial)
        self._master.sendall(self._found.text.encode())
        signal.signal(signal.SIGCHLD, signal.SIG_IGN)  # nothing of copies that have ended is kept
        while True:
            data, pipes, *_ = socket.recv_fds(self._master, MESSAGE, PIPES)
            if not data:
                return
            if not (child := os.fork()):
                self._copy(json.loads(data), pipes)
            for pipe in pipes:
                os.close(pipe)
            self._master.sendall(b"%d" % child)

    def _copy(self, folder: str, pipes: list[int]) -> None:
        """The first process of a copy: it waits for the second one, and is what the master ends."""
        signal.signal(signal.SIGCHLD, signal.SIG_DFL)
        die_with_parent()
        os.setsid()
        self._master.close()
        os.dup2(pipes[2], 2)
        root, own = "", not self._found.namespaces and sys.platform == "linux"
        try:
            if own:
                root = unshare(self._readable, folder)
            if child := os.fork():
                for pipe in (*pipes, 2):  # the end of the FMU is the end of these
                    os.close(pipe)
                os.waitpid(child, 0)
                os._exit(0)
            die_with_parent()
            if own:
                enter_root(root)
        except OSError as error:
            os.write(2, f"it cannot be confined: {error}\n".encode())
            os._exit(1)
        second = os.fork()
        if not second:
            self._run(folder, pipes, own)
        for pipe in (*pipes[:3], pipes[4], 2):
            os.close(pipe)
        while (ended := os.wait())[0] != second:
            pass  # orphans in new namespaces are children of this process, too
        os.write(pipes[3], b"%d" % os.waitstatus_to_exitcode(ended[1]))
        if not own:  # what it has started; in new namespaces that ends with this process
            os.killpg(0, signal.SIGKILL)
        os._exit(0)

    def _run(self, folder: str, pipes: list[int], own: bool) -> None:
        """The process that runs the FMU; ``own``: whether in namespaces of its own."""
        die_with_parent()
        code = 1
        try:
            os.chdir(folder)
            os.environ.update(dict.fromkeys(("HOME", "TMPDIR", "TMP", "TEMP"), folder))
            os.dup2(pipes[0], 0)
            os.dup2(pipes[1], 1)
            opened = socket.socket(fileno=pipes[4])
            for pipe in pipes[:4]:
                os.close(pipe)
            if sys.platform == "linux":
                restrict(self._found, self._readable, [folder])
                with opened, suppress(OSError):  # an old kernel
                    install(opened)
                if own or self._found.version:
                    refuse_sharing()
            serve(self._model)
            code = 0
        except OSError as error:
            with suppress(OSError):
                os.write(2, f"it cannot be confined: {error}\n".encode())
        finally:
            os._exit(code)


def main() -> None:
    """Serve the master, whose connection is the standard input."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the master handles Ctrl-C
    end_with_parent(os.getppid())
    master = socket.socket(fileno=os.dup(0))
    os.dup2(os.open(os.devnull, os.O_RDWR), 0)
    means, archive, unpacked, folder = json.loads(master.recv(MESSAGE))
    model = FmuModel(Path(archive), Path(unpacked))
    readable = [*needed_folders(), unpacked]
    _ForkServer(master, model, readable).serve(means, folder)


if __name__ == "__main__":
    main()
