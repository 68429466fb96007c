"""What a process may see of its computer: own namespaces and Landlock, where Linux has them.

Both are open to every user. Namespaces (user_namespaces(7)) give a process its own tree of files, in
which only programs and libraries are, its own processes, and no network. Landlock (landlock(7)) refuses
to open what is not allowed, and to look into other processes. Either may be missing: containers and some
distributions forbid namespaces, old kernels have no Landlock.
"""

from __future__ import annotations

import ctypes
import os
import platform
import sys
import sysconfig
from collections.abc import Callable, Sequence
from contextlib import suppress
from pathlib import Path
from typing import NamedTuple

NAMESPACES, LANDLOCK = MEANS = ("namespaces", "landlock")
# What programs need in order to run, and what libraries ask of the processor.
SYSTEM = ("/usr", "/bin", "/sbin", "/lib", "/lib32", "/lib64", "/etc", "/sys/devices/system/cpu")
PACKAGES = ("site-packages", "dist-packages")  # folders of installed Python packages
DEVICES = ("/dev/null", "/dev/zero", "/dev/full", "/dev/random", "/dev/urandom")
ABOUT_COMPUTER = ("/proc/cpuinfo", "/proc/meminfo", "/proc/stat")
PROCESSES, SHARED, TEMPORARY = "/proc", "/dev/shm", "/tmp"
ROOM = "size=256m,mode=755"  # of the files that a process makes in its namespaces; chosen
INSIDE = 1000  # number of the user in the namespaces, who is not root there; chosen

# Of linux/sched.h, linux/mount.h, linux/prctl.h, linux/securebits.h and linux/capability.h.
UNSHARED = 0x20000 | 0x8000000 | 0x10000000 | 0x20000000 | 0x40000000  # NS, IPC, USER, PID, NET
RDONLY, NOSUID, NODEV, NOEXEC, REMOUNT, BIND, REC, PRIVATE = 1, 2, 4, 8, 0x20, 0x1000, 0x4000, 0x40000
DETACH, SET_SECUREBITS, SET_NO_NEW_PRIVS, NO_ROOT = 2, 28, 38, 3
CAPABILITIES = 0x20080522
# Numbers of system calls without a function in the C library: of x86_64, and of newer ones anywhere.
PIVOT_ROOT, CAPSET = (155, 126) if platform.machine() == "x86_64" else (41, 91)
CREATE_RULESET, ADD_RULE, RESTRICT_SELF = 444, 445, 446

# Rights of linux/landlock.h, by the version that introduced them.
EXECUTE, WRITE_FILE, READ_FILE, READ_DIR, TRUNCATE = 1 << 0, 1 << 1, 1 << 2, 1 << 3, 1 << 14
ON_FILES = ((1, (1 << 13) - 1), (2, 1 << 13), (3, TRUNCATE), (5, 1 << 15))
READ, OF_FILES = EXECUTE | READ_FILE | READ_DIR, EXECUTE | WRITE_FILE | READ_FILE | TRUNCATE
NETWORK, SCOPES = (4, 0b11), (6, 0b11)  # TCP; abstract sockets and signals
VERSION, PATH_BENEATH = 1, 1


class Confinement(NamedTuple):
    """What a system offers, or why not.

    Attributes:
        namespaces, landlock: empty if it is available, else the reason why not.
        version: of Landlock; 0 if there is none.
    """

    namespaces: str
    landlock: str
    version: int

    @property
    def text(self) -> str:
        """What is in force, in words; begins with "unconfined" where nothing is."""
        there = [] if self.namespaces else ["namespaces (user, files, processes, network)"]
        there += [f"Landlock {self.version}"] if self.version else []
        missing = [f"no namespaces ({self.namespaces})"] if self.namespaces else []
        missing += [] if self.version else [f"no Landlock ({self.landlock})"]
        own = ", ".join(["own process in an empty folder", *there])
        stated = "; ".join([own, *missing])
        return stated if there else f"unconfined: {stated}"


def available(means: Sequence[str], trial: Callable[[Confinement], str]) -> Confinement:
    """What of some means this system has.

    Args:
        means: of :data:`MEANS`.
        trial: enters namespaces in a process of its own; returns why that fails, or nothing.
    """
    if sys.platform != "linux":
        return Confinement("only Linux has them", "only Linux has it", 0)
    version = _libc().syscall(CREATE_RULESET, None, ctypes.c_size_t(0), VERSION)
    why = "" if version > 0 else os.strerror(ctypes.get_errno())
    landlock = ("", version) if LANDLOCK in means and version > 0 else (why or "not asked for", 0)
    found = Confinement("", *landlock)
    refused = trial(found) if NAMESPACES in means else "not asked for"
    return found._replace(namespaces=refused)


def needed_folders() -> list[str]:
    """What a process of Python needs to read: the system, Python, its packages, and this one."""
    own = Path(__file__).resolve().parents[2]
    python = [sys.prefix, sys.base_prefix, sysconfig.get_path("stdlib")]
    # Those of the user and of other environments too, which a Python FMU may import; no other folder of
    # sys.path, as an editable installation is a folder of the user's files.
    packages = [p for p in sys.path if Path(p).name in PACKAGES]
    places = [*SYSTEM, *python, *packages, str(own), str(own.with_name("cybership"))]
    return [p for p in dict.fromkeys(places) if os.path.isdir(p) and p != "/"]


def unshare(readable: Sequence[str], folder: str) -> str:
    """Enter namespaces of files, of users, of the network, and of the processes that follow.

    Args:
        readable: folders that stay, to be read only.
        folder: on which the new tree of files is made; in it the folder is there again, empty.

    Returns:
        The new tree of files, for :func:`enter_root` in the next process.

    Raises:
        OSError: the system refuses.
    """
    user, group = os.geteuid(), os.getegid()
    _done(_libc().unshare(UNSHARED))
    Path("/proc/self/setgroups").write_text("deny")
    Path("/proc/self/uid_map").write_text(f"{INSIDE} {user} 1")
    Path("/proc/self/gid_map").write_text(f"{INSIDE} {group} 1")
    _mount(None, "/", None, REC | PRIVATE)
    _mount("files", folder, "tmpfs", NOSUID | NODEV, ROOM)
    root = Path(folder)
    places: list[str] = []
    for place in [*readable, *DEVICES]:
        inside = root / place[1:]
        if any(Path(place).is_relative_to(p) for p in places):
            continue
        places.append(place)
        inside.parent.mkdir(parents=True, exist_ok=True)
        if os.path.islink(place):
            inside.symlink_to(os.readlink(place))
            continue
        if place in DEVICES:
            inside.touch()
        else:
            inside.mkdir(exist_ok=True)
        _mount(place, str(inside), None, BIND | REC)
        if place not in DEVICES:
            held = os.statvfs(place).f_flag & (NOSUID | NODEV | NOEXEC)
            _mount(None, str(inside), None, REMOUNT | BIND | RDONLY | held)
    for made in (folder, PROCESSES, SHARED, TEMPORARY):
        (root / made[1:]).mkdir(parents=True, exist_ok=True)
    return folder


def enter_root(root: str) -> None:
    """Take a new tree of files for the old one, in the first process of new namespaces.

    Raises:
        OSError: the system refuses.
    """
    with suppress(OSError):  # containers forbid it: then there are no files about processes
        _mount("proc", f"{root}{PROCESSES}", "proc", NOSUID | NODEV | NOEXEC)
    os.chdir(root)
    libc = _libc()
    _done(libc.syscall(PIVOT_ROOT, b".", b"."))
    _done(libc.umount2(b".", DETACH))
    os.chdir("/")


def restrict(found: Confinement, readable: Sequence[str], writable: Sequence[str]) -> None:
    """Give up all rights but those on some folders, for good.

    Args:
        found: what the system has.
        readable, writable: folders.

    Raises:
        OSError: the system refuses.
    """
    libc = _libc()
    _done(libc.prctl(SET_NO_NEW_PRIVS, 1, 0, 0, 0))
    if found.version:
        own = not found.namespaces
        every = [*writable, *((PROCESSES, SHARED, TEMPORARY) if own else ())]
        _landlock(found.version, [*readable, *(() if own else ABOUT_COMPUTER)], [*every, *DEVICES])
    libc.prctl(SET_SECUREBITS, NO_ROOT, 0, 0, 0)  # what a user without rights may not need to do
    header = (ctypes.c_uint32 * 2)(CAPABILITIES, 0)
    _done(libc.syscall(CAPSET, header, (ctypes.c_uint32 * 6)()))


def _landlock(version: int, readable: Sequence[str], writable: Sequence[str]) -> None:
    libc = _libc()
    files = sum(bits for since, bits in ON_FILES if version >= since)
    words = [files, *(bits for since, bits in (NETWORK, SCOPES) if version >= since)]
    attributes = (ctypes.c_uint64 * len(words))(*words)
    size = ctypes.c_size_t(ctypes.sizeof(attributes))
    ruleset = _done(libc.syscall(CREATE_RULESET, attributes, size, 0))
    for rights, places in ((READ, readable), (files, writable)):
        for place in places:
            if not os.path.exists(place):
                continue
            opened = os.open(place, os.O_PATH | os.O_CLOEXEC)
            allowed = rights & files if os.path.isdir(place) else rights & files & OF_FILES
            rule = allowed.to_bytes(8, sys.byteorder) + opened.to_bytes(4, sys.byteorder)
            _done(libc.syscall(ADD_RULE, ruleset, PATH_BENEATH, rule, 0))
            os.close(opened)
    _done(libc.syscall(RESTRICT_SELF, ruleset, 0))
    os.close(ruleset)


def _libc() -> ctypes.CDLL:
    return ctypes.CDLL(None, use_errno=True)


def _done(result: int) -> int:
    if result < 0:
        raise OSError(ctypes.get_errno(), os.strerror(ctypes.get_errno()))
    return result


def _mount(source: str | None, target: str, kind: str | None, flags: int, data: str = "") -> None:
    texts = [None if x is None else x.encode() for x in (source, target, kind, data or None)]
    _done(_libc().mount(*texts[:3], ctypes.c_ulong(flags), texts[3]))
