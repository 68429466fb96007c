"""The process of an isolated FMU in parts: its answers, the system calls it may make, and what confines it."""

import ctypes
import json
import math
import os
import struct
import sys
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cosim import InputError, SimulationError
from cosim.fmu.isolation import confinement, opened_files, system_calls, worker
from cosim.fmu.isolation.channel import (
    CALL,
    DIVERGED,
    DONE,
    FAILED,
    GET,
    LOG,
    MOVE,
    MOVE_HEAD,
    PUT,
    REFUSED,
    STEP,
    FeedbackTerm,
)
from cosim.fmu.isolation.confinement import Confinement
from cosim.fmu.isolation.worker import Worker
from cosim.process import spawned

linux = pytest.mark.skipif(sys.platform != "linux", reason="only Linux has these calls")

# Answers


class Pipe:
    """A channel with requests, which keeps the answers."""

    def __init__(self, *requests):
        self.requests, self.answers = [*requests], []

    def receive(self):
        if not self.requests:
            raise EOFError
        return self.requests.pop(0)

    def send(self, kind, body):
        self.answers.append((kind, body))

    def send_json(self, kind, body):
        self.answers.append((kind, body))


class Instance:
    """Two inputs a, b and an output y, y' = a + 2 b; what is asked of it is kept."""

    def __init__(self, name="", model=None, listener=None):
        self.listener, self.asked = listener, []
        self.component = SimpleNamespace(can_redo=True)
        self.values = {"a": 0.0, "b": 0.0, "y": 1.0}

    def bind(self, inputs, outputs, memory, h):
        self.places = [(p.variable.name, p.slot) for p in (*inputs, *outputs)]
        values = memory.octets.cast("d")

        def put():
            self.asked.append("put")
            for p in inputs:
                self.values[p.variable.name] = values[p.slot]

        def get():
            self.asked.append("get")
            for p in outputs:
                values[p.slot] = self.values[p.variable.name]

        def step(t):
            self.asked.append(("step", t))
            self.values["y"] += h * (self.values["a"] + 2.0 * self.values["b"])
            get()

        return SimpleNamespace(put=put, get=get, step=step)

    def set_up(self, stop):
        self.asked.append(("set up", stop))

    def set_value(self, v, value):
        self.values[v.name] = value

    def get_value(self, v):
        return self.values[v.name]

    def reset(self, listener):
        self.asked.append(("reset", listener))

    def free(self):
        self.asked.append("free")

    def refuse(self):
        raise InputError("it refuses")

    def fail(self):
        raise SimulationError("it fails")

    def __getattr__(self, name):
        if name.startswith("__"):
            raise AttributeError(name)
        return lambda *_: self.asked.append(name)


def model():
    return SimpleNamespace(variables={n: SimpleNamespace(name=n) for n in "aby"}, alone=False)


def call(*words):
    return CALL, json.dumps(words).encode()


def move(actions, t, *inputs):
    return MOVE, MOVE_HEAD.pack(actions, t) + struct.pack(f"<{len(inputs)}d", *inputs)


@pytest.fixture
def served(monkeypatch):
    """Serves requests to an FMU that is known; returns the answers, and the worker."""
    monkeypatch.setattr(worker, "LocalInstance", Instance)

    def serve(*requests, known=True):
        pipe = Pipe(*requests)
        made = Worker(pipe, model() if known else None)
        made.serve()
        return pipe.answers, made

    return serve


BEGIN = (call("start", "m", "p", "f"), call("bind", ["a", "b"], ["y"], 0.5, False))


def test_each_request_has_an_answer_and_an_error_ends_nothing(served):
    answers, made = served(
        BEGIN[0], call("get_value", "y"), call("set_value", "y", 7.0), call("get_value", "y"), call("refuse"),
        call("fail"), call("terminate"), call("free"), call("reset"),
    )  # fmt: skip
    assert answers == [
        (DONE, b"null"), (DONE, b"1.0"), (DONE, b"null"), (DONE, b"7.0"), (REFUSED, b"it refuses"),
        (FAILED, b"it fails"), (DONE, b"null"), (DONE, b"null"), (DONE, b"null"),
    ]  # fmt: skip
    assert made._instance.asked == ["terminate", "free", ("reset", None)]
    assert made._model.alone is True
    assert made._instance.listener is None, "nobody reads what a confined FMU logs"


def test_what_an_fmu_logs_is_sent_where_somebody_reads_it(served, monkeypatch):
    monkeypatch.setattr(
        worker, "FmuModel", lambda path, folder: SimpleNamespace(path=path, folder=folder, variables={})
    )
    answers, made = served(BEGIN[0], call("reset"), known=False)
    made._instance.listener("m", 1, "a warning")
    assert answers[-1] == (LOG, [1, "a warning"])
    assert (str(made._model.path), str(made._model.folder)) == ("p", "f")
    assert made._instance.asked == [("reset", made._instance.listener)]


def test_values_are_exchanged_in_the_order_put_step_get(served):
    answers, made = served(
        *BEGIN,
        move(PUT | STEP, 2.0, 3.0, 0.5),
        move(STEP, 2.5),
        move(GET, 0.0),
        move(PUT, 0.0, 9.0, 8.0),
    )
    assert [np.frombuffer(body).tolist() for _, body in answers[2:]] == [[3.0], [5.0], [5.0], [5.0]]
    assert made._instance.asked == ["put", ("step", 2.0), "get", ("step", 2.5), "get", "get", "put"]
    assert made._instance.values == {"a": 9.0, "b": 8.0, "y": 5.0}
    assert made._instance.places == [("a", 0), ("b", 1), ("y", 2)]
    assert made._instance.component.can_redo is False
    _, kept = served(BEGIN[0], call("bind", ["a"], ["y"], 0.5, True))
    assert kept._instance.component.can_redo is True


def whole_run(served, inputs, terms=(), start=None, h=0.5):
    rows = np.array(inputs, float)
    run = [start or {}, rows.tobytes().hex(), len(rows), [list(t) for t in terms]]
    asked = call("whole_runs", [run], h)
    answers, made = served(*BEGIN, asked)
    kind, body = answers[-1]
    assert kind == DONE
    return np.frombuffer(bytes.fromhex(*json.loads(body))), made._instance


def test_a_whole_run_has_the_outputs_at_its_start_and_after_each_step(served):
    found, instance = whole_run(served, [[1.0, 0.0], [0.0, 2.0], [4.0, 0.0]], start={"y": 3.0})
    assert found.tolist() == [3.0, 3.5, 5.5, 7.5]
    assert instance.asked == [
        ("set up", 1.5), "enter_initialization", "put", "exit_initialization", "get",
        "put", ("step", 0.0), "get", "put", ("step", 0.5), "get", "put", ("step", 1.0), "get", "terminate",
    ]  # fmt: skip


def test_whole_runs_are_apart_by_a_reset(served):
    runs = [
        [{"y": y}, np.array([[a, 0.0]]).tobytes().hex(), 1, []] for y, a in ((3.0, 1.0), (-1.0, 2.0))
    ]
    answers, made = served(*BEGIN, call("whole_runs", runs, 0.5))
    stated = [np.frombuffer(bytes.fromhex(x)).tolist() for x in json.loads(answers[-1][1])]
    assert stated == [[3.0, 3.5], [-1.0, 0.0]]
    one = [
        "set up",
        "enter_initialization",
        "put",
        "exit_initialization",
        "get",
        "put",
        "step",
        "get",
        "terminate",
    ]
    asked = [a[0] if isinstance(a, tuple) else a for a in made._instance.asked]
    assert asked == [*one, "reset", *one]


@pytest.mark.parametrize("power", [0, 1, 2, 3])
@pytest.mark.parametrize("rate", [False, True])
def test_a_term_is_added_to_an_input_before_each_step(served, power, rate):
    """y' = a + 2 (b + c f(y)); the rate is that of the last two outputs."""
    term = FeedbackTerm(1, 0, power, rate, -0.2)
    found, _ = whole_run(served, [[1.0, 0.0]] * 5, [term], {"y": -2.0})
    y = [-2.0]
    for k in range(5):
        seen = (y[k] - y[max(k - 1, 0)]) / 0.5 if rate else y[k]
        f = {0: seen if rate else 1.0, 1: seen, 2: seen * abs(seen), 3: seen**3}[power]
        y.append(y[-1] + 0.5 * (1.0 - 2.0 * 0.2 * f))
    assert found == pytest.approx(y)


def test_a_term_may_turn_with_an_output(served):
    terms = [FeedbackTerm(0, 0, 1, False, 2.0, 0.7, 0.3), FeedbackTerm(0, 0, 0, False, 0.5)]
    found, _ = whole_run(served, [[0.0, 0.0]] * 3, terms, {"y": 1.5})
    y = [1.5]
    for _ in range(3):
        y.append(y[-1] + 0.5 * (2.0 * math.cos(0.7 * y[-1] + 0.3) + 0.5))
    assert found == pytest.approx(y)


@pytest.mark.parametrize(("last", "rows"), [(3.0 * DIVERGED, 3), (np.nan, 3), (1.0, 5)])
def test_a_run_that_diverges_ends(served, last, rows):
    found, instance = whole_run(served, [[0.0, 0.0], [last, 0.0], [0.0, 0.0], [0.0, 0.0]])
    assert found.size == rows
    assert ("terminate" in instance.asked) == (rows == 5)


# System calls


def decided(lines, architecture, number):
    """What a filter of Berkeley's packet filter machine returns for a call."""
    place, loaded = 0, 0
    while True:
        code, yes, no, k = lines[place]
        place += 1
        if code == system_calls.LOAD:
            loaded = {0: number, 4: architecture}[k]
        elif code == system_calls.RETURN:
            return k
        elif code == system_calls.JUMP_IF_EQUAL:
            place += yes if loaded == k else no
        else:
            assert code == system_calls.JUMP_IF_AT_LEAST
            place += yes if loaded >= k else no


@pytest.fixture
def filters(monkeypatch):
    found = []
    monkeypatch.setattr(
        system_calls, "set_filter", lambda lines, flags=0: found.append((lines, flags)) or 9
    )
    monkeypatch.setattr(
        opened_files, "set_filter", lambda lines, flags=0: found.append((lines, flags)) or 9
    )
    return found


@pytest.mark.parametrize("machine", ["x86_64", "aarch64"])
def test_calls_that_share_with_others_are_refused_and_all_else_is_allowed(filters, monkeypatch, machine):
    monkeypatch.setattr(system_calls, "MACHINE", machine)
    system_calls.refuse_sharing()
    ((lines, flags),) = filters
    assert flags == 0
    refused = system_calls.SHARING[machine]
    for number in range(600):
        wanted = system_calls.REFUSE if number in refused else system_calls.ALLOW
        assert decided(lines, system_calls.ARCH, number) == wanted
    for number in (0x40000000, 0x40000000 + 1, 2**32 - 1):
        assert decided(lines, system_calls.ARCH, number) == system_calls.REFUSE
    assert decided(lines, system_calls.ARCH, 0x3FFFFFFF) == system_calls.ALLOW
    assert decided(lines, system_calls.ARCH + 1, 0) == system_calls.REFUSE, "another interface"
    monkeypatch.setattr(system_calls, "MACHINE", "other")
    system_calls.refuse_sharing()
    assert len(filters) == 1


@linux
@pytest.mark.parametrize("opening", [(2, 257, 437), (-1, 56, 437)])
def test_the_master_is_notified_of_each_file_that_is_opened(filters, monkeypatch, opening):
    monkeypatch.setattr(opened_files, "OPENING", opening)
    sent, closed = [], []
    monkeypatch.setattr(opened_files.socket, "send_fds", lambda to, data, fds: sent.append((to, fds)))
    monkeypatch.setattr(opened_files.os, "close", closed.append)
    opened_files.install("master")
    ((lines, flags),) = filters
    assert flags == opened_files.NEW_LISTENER
    for number in range(500):
        wanted = opened_files.NOTIFY if number in opening else opened_files.ALLOW
        assert decided(lines, system_calls.ARCH, number) == wanted
    # The numbers of another interface are others; they name no file.
    assert decided(lines, system_calls.ARCH + 1, opening[1]) == opened_files.ALLOW
    assert (sent, closed) == ([("master", [9])], [9])


@pytest.mark.parametrize(
    ("path", "found"),
    [
        ("/home/user/secret", "/home/user/secret"), ("/opt/fmu/a", None), ("/opt/fmu", None), ("/opt", None), ("/", None),
        ("relative", None), ("/opt/fmu/../x", "/opt/x"), ("/opt/fmux", "/opt/fmux"), ("/dev/null", None),
        ("/proc/cpuinfo", None), ("/proc/17/mem", "/proc/17/mem"), ("/proc/self/maps", None), ("/op", "/op"),
    ],
)  # fmt: skip
def test_files_beyond_what_it_may_open_are_named(path, found):
    named = []
    of = object.__new__(opened_files.OpenedFiles)
    of._found = named.append
    of._allowed = tuple(f"{p.rstrip('/')}/" for p in ("/opt/fmu/", *opened_files.USUAL))
    of._look(path)
    assert named == ([] if found is None else [found])


@linux
@pytest.mark.parametrize("length", [5, 300, 5000])
def test_a_path_is_read_from_the_memory_of_the_process(length):
    text = ctypes.create_string_buffer(b"/" + b"x" * (length - 1))
    found = opened_files._text(os.getpid(), ctypes.addressof(text))
    most = 256 + opened_files.LONGEST
    assert found == ("/" + "x" * (length - 1))[:most]
    assert opened_files._text(os.getpid(), 0) == ""


# What confines it


@pytest.mark.parametrize(
    ("found", "text"),
    [
        (
            Confinement("", "", 4),
            "own process in an empty folder, namespaces (user, files, processes, network), Landlock 4",
        ),
        (
            Confinement("no", "", 2),
            "own process in an empty folder, Landlock 2; no namespaces (no)",
        ),
        (
            Confinement("", "old", 0),
            "own process in an empty folder, namespaces (user, files, processes, network); no Landlock (old)",
        ),
        (
            Confinement("no", "old", 0),
            "unconfined: own process in an empty folder; no namespaces (no); no Landlock (old)",
        ),
    ],
)
def test_what_is_in_force_is_said(found, text):
    assert found.text == text


class Kernel:
    """A C library whose calls are kept; answers by the number of a system call, or the name of a function."""

    def __init__(self, **answers):
        self.calls, self.answers = [], answers

    def __getattr__(self, name):
        def called(*arguments):
            plain = tuple(
                a.value if isinstance(a, ctypes.c_ulong | ctypes.c_size_t) else a for a in arguments
            )
            self.calls.append((name, *plain))
            return self.answers.get(f"{name}_{plain[0]}", self.answers.get(name, 0))

        return called

    def named(self, name):
        return [c[1:] for c in self.calls if c[0] == name]


@pytest.fixture
def kernel(monkeypatch):
    made = Kernel()
    monkeypatch.setattr(confinement, "_libc", lambda: made)
    return made


BOTH = confinement.MEANS


@pytest.mark.parametrize(
    ("means", "version", "refused", "wanted"),
    [
        (BOTH, 4, "", ("", "", 4)),
        (BOTH, 4, "refused", ("refused", "", 4)),
        (("landlock",), 4, "", ("not asked for", "", 4)),
        (("namespaces",), 4, "", ("", "not asked for", 0)),
        (BOTH, 0, "", ("", os.strerror(0), 0)),
    ],
)
def test_what_a_system_has_of_what_is_asked_for(kernel, monkeypatch, means, version, refused, wanted):
    monkeypatch.setattr(confinement.sys, "platform", "linux")
    monkeypatch.setattr(confinement.ctypes, "get_errno", lambda: 0)
    kernel.answers = {f"syscall_{confinement.CREATE_RULESET}": version}
    tried = []
    found = confinement.available(means, lambda c: tried.append(c) or refused)
    assert found == wanted
    assert tried == ([Confinement("", *wanted[1:])] if "namespaces" in means else [])
    assert kernel.calls == [("syscall", confinement.CREATE_RULESET, None, 0, 1)]
    monkeypatch.setattr(confinement.sys, "platform", "win32")
    assert confinement.available(means, None).version == 0


def test_a_process_ends_with_its_parent(kernel, monkeypatch):
    monkeypatch.setattr(ctypes, "CDLL", lambda name: kernel)
    monkeypatch.setattr(spawned.sys, "platform", "linux")
    spawned.die_with_parent()
    assert kernel.calls == [("prctl", 1, 9, 0, 0, 0)]
    monkeypatch.setattr(spawned.sys, "platform", "darwin")
    spawned.die_with_parent()
    assert len(kernel.calls) == 1


@linux
def test_a_new_tree_has_what_may_be_read_and_nothing_else(kernel, monkeypatch, tmp_path):
    real, folder = tmp_path / "real", tmp_path / "own"
    for name in ("a/b", "c"):
        (real / name).mkdir(parents=True)
    (real / "link").symlink_to("a")
    folder.mkdir()
    written = {}
    monkeypatch.setattr(
        confinement.Path, "write_text", lambda self, text: written.update({str(self): text})
    )
    monkeypatch.setattr(confinement.os, "geteuid", lambda: 17)
    monkeypatch.setattr(confinement.os, "getegid", lambda: 18)
    monkeypatch.setattr(confinement.os, "statvfs", lambda place: SimpleNamespace(f_flag=0x1002))
    readable = [str(real / n) for n in ("a", "a/b", "link", "c")]
    assert confinement.unshare(readable, str(folder)) == str(folder)
    assert kernel.named("unshare") == [(0x78020000,)]
    assert written == {
        "/proc/self/setgroups": "deny", "/proc/self/uid_map": "1000 17 1", "/proc/self/gid_map": "1000 18 1",
    }  # fmt: skip
    mounts = kernel.named("mount")
    assert mounts[0] == (None, b"/", None, 0x44000, None), "nothing that follows is seen outside"
    assert mounts[1] == (b"files", str(folder).encode(), b"tmpfs", 6, b"size=256m,mode=755")
    inside = {n: f"{folder}{real}/{n}".encode() for n in ("a", "c")}
    for name, pair in zip(("a", "c"), (mounts[2:4], mounts[4:6]), strict=True):
        assert pair[0] == (str(real / name).encode(), inside[name], None, 0x5000, None)
        # To be read only, and with what its file system has: no set-user-id here.
        assert pair[1] == (None, inside[name], None, 0x20 | 0x1000 | 1 | 2, None)
    devices = [m[0].decode() for m in mounts[6:]]
    assert devices == [*confinement.DEVICES]
    assert all(m[3] == 0x5000 for m in mounts[6:])
    assert os.readlink(f"{folder}{real}/link") == "a"
    assert not os.path.lexists(f"{folder}{real}/a/b"), "it is in its parent"
    for place in (str(folder), "/proc", "/dev/shm", "/tmp"):
        assert os.path.isdir(f"{folder}{place}")
    assert os.path.isfile(f"{folder}/dev/null")
    kernel.answers = {"unshare": -1}
    with pytest.raises(OSError, match="Errno"):
        confinement.unshare(readable, str(folder))


def test_the_new_tree_takes_the_place_of_the_old_one(kernel, monkeypatch):
    went = []
    monkeypatch.setattr(confinement.os, "chdir", went.append)
    confinement.enter_root("/own")
    assert kernel.calls == [
        ("mount", b"proc", b"/own/proc", b"proc", 2 | 4 | 8, None), ("syscall", confinement.PIVOT_ROOT, b".", b"."),
        ("umount2", b".", 2),
    ]  # fmt: skip
    assert went == ["/own", "/"]
    kernel.answers = {"mount": -1}
    confinement.enter_root("/own")  # containers forbid it
    kernel.answers = {f"syscall_{confinement.PIVOT_ROOT}": -1}
    with pytest.raises(OSError, match="Errno"):
        confinement.enter_root("/own")


@pytest.mark.parametrize("own", [True, False])
@pytest.mark.parametrize("version", [0, 4])
def test_all_rights_but_those_on_some_folders_are_given_up(kernel, monkeypatch, own, version):
    asked = []
    monkeypatch.setattr(confinement, "_landlock", lambda *of: asked.append(of))
    confinement.restrict(Confinement("" if own else "no", "", version), ["/r"], ["/w"])
    assert kernel.named("prctl") == [(38, 1, 0, 0, 0), (28, 3, 0, 0, 0)]
    ((number, header, none),) = kernel.named("syscall")
    assert (number, [*header], [*none]) == (confinement.CAPSET, [0x20080522, 0], [0] * 6)
    if not version:
        assert asked == []
        return
    devices = [*confinement.DEVICES]
    if own:
        assert asked == [(4, ["/r"], ["/w", "/proc", "/dev/shm", "/tmp", *devices])]
    else:
        assert asked == [(4, ["/r", *confinement.ABOUT_COMPUTER], ["/w", *devices])]


@linux
@pytest.mark.parametrize(
    ("version", "files", "more"),
    [
        (1, 0x1FFF, []),
        (2, 0x3FFF, []),
        (3, 0x7FFF, []),
        (4, 0x7FFF, [3]),
        (5, 0xFFFF, [3]),
        (6, 0xFFFF, [3, 3]),
    ],
)
def test_rules_give_the_rights_that_a_version_knows(kernel, monkeypatch, tmp_path, version, files, more):
    (tmp_path / "file").write_text("")
    kernel.answers = {f"syscall_{confinement.CREATE_RULESET}": 77}
    closed = []
    monkeypatch.setattr(confinement.os, "open", lambda place, flags: 5)
    monkeypatch.setattr(confinement.os, "close", closed.append)
    confinement._landlock(version, [str(tmp_path), str(tmp_path / "none")], [str(tmp_path / "file")])
    create, read, write, last = kernel.named("syscall")
    assert [*create[1]] == [files, *more]
    assert create[2:] == (8 * (1 + len(more)), 0)

    def rule(rights):
        return rights.to_bytes(8, sys.byteorder) + (5).to_bytes(4, sys.byteorder)

    assert read == (confinement.ADD_RULE, 77, 1, rule(0b1101), 0)
    # Of a file nothing that belongs to folders: execute, write, read and truncate.
    assert write == (confinement.ADD_RULE, 77, 1, rule((0b111 | 1 << 14) & files), 0)
    assert last == (confinement.RESTRICT_SELF, 77, 0)
    assert closed == [5, 5, 77]


def test_folders_that_python_needs_are_there_and_never_the_whole_tree(monkeypatch):
    monkeypatch.setattr(confinement.sys, "prefix", "/")
    found = confinement.needed_folders()
    assert "/" not in found
    assert all(os.path.isdir(p) for p in found)
    assert len({*found}) == len(found)
    assert os.path.dirname(os.path.dirname(os.path.dirname(confinement.__file__))) in found


@given(st.integers(-5, 5))
def test_a_refused_call_is_an_error(result):
    if result < 0:
        with pytest.raises(OSError, match="Errno"):
            confinement._done(result)
    else:
        assert confinement._done(result) == result


@linux
def test_a_filter_is_given_to_the_kernel_as_it_is_laid_out(monkeypatch):
    lines = [(0x20, 0, 0, 4), (0x06, 1, 2, 0x7FFF0000)]
    seen = []

    class Library:
        def __init__(self, name, use_errno):
            self.answer = 0

        def syscall(self, number, operation, flags, program):
            count, address = struct.unpack("@HxxxxxxQ", program)
            seen.append((number, operation, flags, ctypes.string_at(address, 8 * count)))
            return 3 if flags else -1

    monkeypatch.setattr(system_calls.ctypes, "CDLL", Library)
    assert system_calls.set_filter(lines, 8) == 3
    code = b"".join(struct.pack("=HBBI", *line) for line in lines)
    assert seen == [(system_calls.SECCOMP, 1, 8, code)]
    with pytest.raises(OSError, match="Errno"):
        system_calls.set_filter(lines)
