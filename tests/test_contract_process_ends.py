"""What is done where a process has ended: by the supervisor, by what remains of a run, and by the fork server."""

import json
import os
import signal
from types import SimpleNamespace

import pytest

from cosim.command import FAILED, INTERRUPTED
from cosim.fmu.isolation import fork_server
from cosim.fmu.isolation.confinement import Confinement
from cosim.process import spawned
from cosim.process.run_state import (
    CAMPAIGN,
    CODE,
    DESCRIPTION,
    ENDED,
    FOLDER,
    HELD,
    LATE,
    LOGGING,
    REQUESTS,
    UNFINISHED,
)
from cosim.supervision import post_mortem, supervising

pytestmark = pytest.mark.skipif(os.name != "posix", reason="not on Windows")


class State:
    """What the process that has ended had written down."""

    def __init__(self, call=("", ""), numbers=None, **texts):
        self.numbers = {LOGGING: 0, CODE: 0, ENDED: 0, REQUESTS: 0, HELD: 0} | (numbers or {})
        self._call, self._texts = call, texts

    def call(self):
        return self._call

    def read(self, place):
        return self._texts.get({FOLDER: "folder", LATE: "late", CAMPAIGN: "campaign", DESCRIPTION: "description",
                                UNFINISHED: "unfinished"}[place], "")  # fmt: skip


@pytest.fixture
def died(monkeypatch):
    """Report of a process that died with a state: exit code, what is said, and of which kind."""
    said, swept = [], []
    monkeypatch.setattr(post_mortem, "ignore_interrupts", lambda: swept.append("ignored"))
    monkeypatch.setattr(post_mortem, "sweep", lambda: swept.append("swept"))
    monkeypatch.setattr(post_mortem, "complain", lambda text, kind="error": said.append((text, kind)))
    monkeypatch.setattr(post_mortem, "is_scratch", lambda path: path.name == "scratch")

    def report(state, code=-11, interrupted=False):
        monkeypatch.setattr(post_mortem, "STATE", state)
        said.clear()
        swept.clear()
        found = post_mortem.report(code, interrupted)
        assert swept == ["ignored", "swept"]
        (line,) = said
        return (found, *line)

    return report


@pytest.mark.parametrize(
    ("code", "text"),
    [(0, "exit code 0"), (7, "exit code 7"), (-11, "signal 11, SIGSEGV"), (-999, "signal 999")],
)
def test_an_end_is_said_in_words(code, text):
    assert spawned.ending(code) == text


def test_a_process_that_died_is_named_with_the_call(died):
    assert died(State()) == (FAILED, "the process of this command died (signal 11, SIGSEGV)", "error")
    assert died(State(("vessel", "its step")), 3) == (
        FAILED, "vessel: the simulating process died in its step (exit code 3)", "error",
    )  # fmt: skip
    assert died(State(("vessel", "its step"), late="vessel: no answer in 5 s"))[1] == (
        "vessel: no answer in 5 s; --timeout sets that"
    )
    assert died(State(), 0, True) == (INTERRUPTED, "interrupted", "")


def logged(folder, text="time,x\n0,1\n1,2\n2,", **content):
    folder.mkdir()
    (folder / "log.csv").write_text(text)
    (folder / "log.json").write_text(json.dumps({"status": "running"} | content))
    return State(("vessel", "its step"), {LOGGING: 1}, folder=str(folder))


@pytest.mark.parametrize("rescued", [5, None])
def test_rows_of_a_run_are_kept_and_its_file_says_how_it_ended(died, tmp_path, monkeypatch, rescued):
    def rescue(path):
        if rescued is None:
            raise OSError
        return rescued

    monkeypatch.setattr(post_mortem, "rescue", rescue)
    folder = tmp_path / "run"
    code, text, _ = died(logged(folder))
    rows = 2 if rescued is None else 5
    assert code == FAILED
    assert text.endswith(f"; {rows} rows are kept in '{post_mortem._shown(str(folder))}'")
    stated = json.loads((folder / "log.json").read_text())
    assert (stated["status"], stated["rows"]) == ("failed", rows)
    assert stated["message"].startswith("vessel: the simulating process died")
    (tmp_path / "scratch").mkdir()
    assert "rows" not in died(State(folder=str(tmp_path / "scratch"), numbers={LOGGING: 1}))[1]


def test_a_run_that_has_said_itself_how_it_ended_is_not_asked_again(died, tmp_path):
    state = logged(tmp_path / "run", status="failed", rows=9, message="it diverged")
    assert died(state)[1].startswith("it diverged; 9 rows are kept")
    assert json.loads((tmp_path / "run" / "log.json").read_text())["status"] == "failed"


@pytest.mark.parametrize("interrupted", [True, False])
def test_before_the_first_row_there_is_a_file_unless_the_user_has_ended_it(
    died, tmp_path, monkeypatch, interrupted
):
    cleared = []
    monkeypatch.setattr(post_mortem, "clear_results", cleared.append)
    state = State(("vessel", "its start"), folder=str(tmp_path), description='{"scenario": 1}')
    code, text, _ = died(state, interrupted=interrupted)
    assert "rows" not in text
    assert (tmp_path / "log.json").exists() != interrupted
    assert cleared == ([] if interrupted else [tmp_path])
    if not interrupted:
        stated = json.loads((tmp_path / "log.json").read_text())
        assert (stated["scenario"], stated["rows"], stated["status"]) == (1, 0, "failed")
    assert code == (INTERRUPTED if interrupted else FAILED)


def test_a_campaign_says_how_many_of_its_runs_are_kept(died, tmp_path):
    summary = tmp_path / "campaign.json"
    summary.write_text(json.dumps({"done": 3, "failed": 1, "runs": 9}))
    code, text, kind = died(State(campaign=str(summary)), interrupted=True)
    where = post_mortem._shown(str(tmp_path))
    assert (code, kind) == (INTERRUPTED, "")
    assert text == f"interrupted: 4 of 9 runs are kept in '{where}'; the same command goes on"
    assert json.loads(summary.read_text())["status"] == "interrupted"
    assert died(State(campaign=str(tmp_path / "none.json")))[1].count("none.json") <= 1


def test_what_was_not_finished_is_removed_and_no_folder_of_others(died, tmp_path):
    own, parent, other = tmp_path / "a" / "own", tmp_path / "a", tmp_path / "b"
    (own / "sub").mkdir(parents=True)
    other.mkdir()
    (other / "file").write_text("")
    died(State(unfinished="\n".join(map(str, (own, parent, other)))))
    assert not parent.exists()
    assert (other / "file").exists()


def test_a_folder_is_named_as_short_as_it_can_be(monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    assert post_mortem._shown(str(tmp_path / "results")) == "results"
    assert post_mortem._shown("/x") == "/x"


# The supervisor


class TestSupervisor:
    @pytest.fixture
    def watching(self, monkeypatch):
        """A supervisor of process 17, whose signals and timers are kept."""
        sent, timers, reported = [], [], []
        state = State()
        clock = SimpleNamespace(now=100.0)
        monkeypatch.setattr(supervising, "STATE", state)
        monkeypatch.setattr(supervising.os, "kill", lambda pid, number: sent.append((pid, number)))
        monkeypatch.setattr(supervising.signal, "setitimer", lambda *of: timers.append(of[1:]))
        monkeypatch.setattr(supervising.signal, "signal", lambda *of: None)
        monkeypatch.setattr(
            supervising,
            "time",
            SimpleNamespace(monotonic=lambda: clock.now, sleep=lambda s: reported.append(s)),
        )
        monkeypatch.setattr(
            supervising, "CallWatch", lambda: SimpleNamespace(is_late=lambda: state.late)
        )
        monkeypatch.setattr(
            post_mortem, "report", lambda code, asked: reported.append((code, asked)) or 9
        )
        state.late = False
        of = supervising._Supervisor(17)
        return SimpleNamespace(
            of=of, sent=sent, timers=timers, reported=reported, state=state, clock=clock
        )

    def test_two_interrupts_at_once_are_one(self, watching):
        w = watching
        w.of._pass_on(signal.SIGINT)
        w.clock.now += 0.05
        w.of._pass_on(signal.SIGINT)
        assert w.sent == [(17, signal.SIGINT)]
        assert w.state.numbers[REQUESTS] == 1
        assert w.timers == [(supervising.GRACE,)]
        w.clock.now += 0.06
        w.of._pass_on(signal.SIGTERM)
        assert w.sent[1:] == [(17, signal.SIGTERM)]
        assert w.state.numbers[REQUESTS] == 2
        assert len(w.timers) == 1, "the second one gives no more time"

    def test_a_process_that_does_not_follow_is_ended_unless_it_moves_files(self, watching):
        w = watching
        w.state.numbers[HELD] = 1
        w.of._end_late()
        assert (w.sent, w.timers) == ([], [(supervising.LOOK,)])
        w.state.numbers[HELD] = 0
        w.of._end_late()
        assert w.sent == [(17, signal.SIGKILL)]

    def test_a_process_that_has_gone_gets_no_signal(self, watching, monkeypatch):
        def gone(pid, number):
            raise ProcessLookupError

        monkeypatch.setattr(supervising.os, "kill", gone)
        watching.of._send(signal.SIGINT)

    def run(self, w, monkeypatch, signals, status=0):
        """Runs until the end, by signals in turn; returns the exit code."""

        def ended(code):
            raise SystemExit(code)

        waits = iter([(0, 0)] * (signals.count(signal.SIGCHLD) - 1) + [(17, status)])
        turn = iter(signals)
        monkeypatch.setattr(supervising.signal, "sigwait", lambda waited: next(turn))
        monkeypatch.setattr(supervising.os, "waitpid", lambda pid, how: next(waits))
        monkeypatch.setattr(supervising.os, "_exit", ended)
        with pytest.raises(SystemExit) as found:
            w.of.run((signal.SIGINT, signal.SIGCHLD, signal.SIGALRM))
        return found.value.code

    def test_the_code_is_that_of_a_command_that_has_ended_itself(self, watching, monkeypatch):
        w = watching
        w.state.numbers |= {ENDED: 1, CODE: 5}
        signals = [signal.SIGALRM, signal.SIGCHLD, signal.SIGCHLD]
        assert self.run(w, monkeypatch, signals, 256) == 5
        assert (w.sent, w.reported) == ([], [])
        assert w.timers == [(supervising.LOOK_AT_CALL, supervising.LOOK_AT_CALL)]

    def test_a_hang_is_ended_and_reported(self, watching, monkeypatch):
        w = watching
        w.state.late = True
        assert self.run(w, monkeypatch, [signal.SIGALRM, signal.SIGCHLD], signal.SIGKILL) == 9
        assert w.sent == [(17, signal.SIGKILL)]
        assert w.reported == [supervising.ONE_REQUEST, (-signal.SIGKILL, False)]

    def test_after_an_interrupt_there_is_some_time(self, watching, monkeypatch):
        w = watching
        signals = [signal.SIGINT, signal.SIGALRM, signal.SIGCHLD]
        assert self.run(w, monkeypatch, signals, 256) == 9
        assert w.sent == [(17, signal.SIGINT), (17, signal.SIGKILL)]
        assert w.reported == [(1, True)], "it does not wait for a signal that has come"


# The fork server


class EndedError(Exception):
    """A process has left."""


class System:
    """The system calls of a process that forks: which process it is, is given by what fork returns."""

    environ, devnull, O_RDWR, WNOHANG = {}, os.devnull, os.O_RDWR, 1
    getenv = staticmethod(os.getenv)

    def __init__(self, *forks, ends=((5, 0),)):
        self.forks, self.ends, self.calls = [*forks], [*ends], []
        self.environ = {}

    def fork(self):
        return self.forks.pop(0)

    def wait(self):
        self.calls.append(("wait",))
        return self.ends.pop(0)

    def waitpid(self, pid, how):
        self.calls.append(("waitpid", pid))
        return self.ends.pop(0)

    def waitstatus_to_exitcode(self, status):
        return os.waitstatus_to_exitcode(status)

    def _exit(self, code):
        self.calls.append(("_exit", code))
        raise EndedError

    def __getattr__(self, name):
        return lambda *of: self.calls.append((name, *of))

    def named(self, name):
        return [c[1:] for c in self.calls if c[0] == name]


@pytest.fixture
def server(monkeypatch):
    """Makes a fork server on a fake system; what confines a copy is kept in its calls."""
    monkeypatch.setattr(fork_server.sys, "platform", "linux")
    monkeypatch.setattr(fork_server.signal, "signal", lambda *of: None)

    def make(system, namespaces="", version=4):
        monkeypatch.setattr(fork_server, "os", system)
        for name in ("die_with_parent", "enter_root", "restrict", "refuse_sharing", "install"):
            monkeypatch.setattr(
                fork_server, name, lambda *of, name=name: system.calls.append((name, *of))
            )
        monkeypatch.setattr(
            fork_server,
            "unshare",
            lambda readable, folder: system.calls.append(("unshare", folder)) or "/root",
        )
        monkeypatch.setattr(fork_server, "serve", lambda model: system.calls.append(("serve", model)))
        opened = SimpleNamespace(__enter__=None)

        class Opened:
            def __enter__(self):
                return opened

            def __exit__(self, *of):
                system.calls.append(("opened closed",))

        monkeypatch.setattr(fork_server.socket, "socket", lambda fileno: Opened())
        master = SimpleNamespace(close=lambda: system.calls.append(("master closed",)), sent=[])
        master.sendall = master.sent.append
        found = fork_server._ForkServer(master, "model", ["/r"])
        found._found = Confinement(namespaces, "", version)
        return found

    return make


PIPES = [10, 11, 12, 13, 14]


def copy(of):
    with pytest.raises(EndedError):
        of._copy("/own", PIPES)


def test_the_first_process_of_a_copy_waits_for_the_second(server):
    system = System(5)
    copy(server(system))
    assert system.named("close") == [(p,) for p in (*PIPES, 2)]
    assert system.named("waitpid") == [(5,)]
    assert system.named("_exit") == [(0,)]
    assert system.named("dup2") == [(12, 2)], "what it prints"
    assert ("die_with_parent",) in system.calls
    assert ("setsid",) in system.calls
    assert ("master closed",) in system.calls
    assert system.named("unshare") == [("/own",)]


@pytest.mark.parametrize("namespaces", ["", "refused"])
def test_the_second_process_says_how_the_fmu_has_ended(server, namespaces):
    system = System(0, 6, ends=[(4, 0), (6, 3 << 8)])
    copy(server(system, namespaces))
    own = not namespaces
    assert system.named("enter_root") == ([("/root",)] if own else [])
    assert system.named("unshare") == ([("/own",)] if own else [])
    assert system.named("close") == [(10,), (11,), (12,), (14,), (2,)]
    assert len(system.named("wait")) == 2, "an orphan is not the FMU"
    assert system.named("write") == [(13, b"3")]
    assert system.named("killpg") == ([] if own else [(0, signal.SIGKILL)])
    assert system.named("_exit") == [(0,)]
    assert len(system.named("die_with_parent")) == 2


def test_a_copy_that_cannot_be_confined_does_not_run(server, monkeypatch):
    system = System()
    of = server(system)

    def refused(*_):
        raise OSError("refused")

    monkeypatch.setattr(fork_server, "unshare", refused)
    copy(of)
    assert system.named("write") == [(2, b"it cannot be confined: refused\n")]
    assert system.named("_exit") == [(1,)]


@pytest.mark.parametrize(("namespaces", "version"), [("", 4), ("", 0), ("refused", 4), ("refused", 0)])
def test_the_third_process_runs_the_fmu_confined(server, namespaces, version):
    system = System(0, 0)
    copy(server(system, namespaces, version))
    assert system.named("chdir") == [("/own",)]
    assert system.environ == dict.fromkeys(("HOME", "TMPDIR", "TMP", "TEMP"), "/own")
    assert system.named("dup2") == [(12, 2), (10, 0), (11, 1)]
    assert system.named("close") == [(10,), (11,), (12,), (13,)]
    names = [c[0] for c in system.calls]
    assert system.named("restrict") == [(Confinement(namespaces, "", version), ["/r"], ["/own"])]
    assert names.index("restrict") < names.index("install") < names.index("serve")
    assert ("refuse_sharing" in names) == (not namespaces or version > 0)
    assert system.named("serve") == [("model",)]
    assert system.named("_exit") == [(0,)]
    assert len(system.named("die_with_parent")) == 3


def test_an_fmu_that_cannot_be_confined_is_not_run(server, monkeypatch):
    system = System(0, 0)
    of = server(system)

    def refused(*_):
        raise OSError("refused")

    monkeypatch.setattr(fork_server, "restrict", refused)
    copy(of)
    assert system.named("serve") == []
    assert system.named("write") == [(2, b"it cannot be confined: refused\n")]
    assert system.named("_exit") == [(1,)]


def test_the_server_makes_a_copy_for_each_request(server, monkeypatch):
    system = System(21, 22)
    of = server(system)
    monkeypatch.setattr(fork_server, "available", lambda means, trial: Confinement("", "", 4))
    requests = iter([(b'"/a"', [1, 2], 0, None), (b'"/b"', [3], 0, None), (b"", [], 0, None)])
    monkeypatch.setattr(fork_server.socket, "recv_fds", lambda *_: next(requests))
    of.serve(["namespaces"], "/own")
    assert of._master.sent == [of._found.text.encode(), b"21", b"22"]
    assert system.named("close") == [(1,), (2,), (3,)]


@pytest.mark.parametrize("why", ["", "Operation not permitted"])
def test_namespaces_are_tried_in_a_process_of_its_own(server, monkeypatch, why):
    """The process that is asked reads what that one writes."""
    real, kept = os, {}
    system = System(ends=[(5, 0)])
    of = server(system)
    reader, writer = real.pipe()
    system.pipe = lambda: (reader, writer)
    system.fdopen = real.fdopen
    system.close = real.close
    system.fork = lambda: (real.write(writer, why.encode()) and 5) or 5
    monkeypatch.setattr(
        fork_server,
        "available",
        lambda means, trial: kept.update(why=trial(Confinement("", "", 4))) or Confinement("", "", 0),
    )
    monkeypatch.setattr(fork_server.socket, "recv_fds", lambda *_: (b"", [], 0, None))
    of.serve(["namespaces"], "/own")
    assert kept["why"] == why
    assert system.named("waitpid") == [(5,)]


@pytest.mark.parametrize(
    ("forks", "ends", "stated", "refused"),
    [
        ((0, 6), [(6, 0)], b"", False),
        ((0, 6), [(6, 256)], b"no own tree of files", False),
        ((0,), [], b"denied", True),
    ],
)
def test_the_process_that_tries_says_why_it_fails(server, monkeypatch, forks, ends, stated, refused):
    system = System(*forks, ends=ends)
    of = server(system)
    system.pipe = lambda: (30, 31)
    if refused:

        def unshare(*_):
            raise OSError(1, "denied")

        monkeypatch.setattr(fork_server, "unshare", unshare)
    monkeypatch.setattr(fork_server, "available", lambda means, trial: trial(Confinement("", "", 4)))
    with pytest.raises(EndedError):
        of.serve(["namespaces"], "/own")
    assert system.named("write") == [(31, stated)]
    assert system.named("_exit") == [(0,)]


def test_the_first_process_of_new_namespaces_confines_itself(server, monkeypatch):
    system = System(0, 0)
    of = server(system)
    system.pipe = lambda: (30, 31)
    monkeypatch.setattr(fork_server, "available", lambda means, trial: trial(Confinement("", "", 4)))
    with pytest.raises(EndedError):
        of.serve(["namespaces"], "/own")
    assert system.named("enter_root") == [("/root",)]
    assert system.named("restrict") == [(Confinement("", "", 4), ["/r"], ["/own"])]
    assert system.named("_exit") == [(0,)]
