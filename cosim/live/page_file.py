"""The page: data, WebAssembly of the FMUs, style and program in one HTML file."""

import hashlib
import html
import json
import os
import zlib
from base64 import b64encode
from collections.abc import Iterable
from pathlib import Path
from string import Template

from cybership.scratch_folder import atomic_write, scratch_folder

from ..errors import InputError
from ..master.algorithm import Master
from ..results.performance import ENERGY, METRICS
from ..system.own_fmus import builder_options, run_builder
from ..system.start_values import Overrides
from ..system.system import System
from .alternatives import alternatives
from .snapshot import Part, snapshot

TEMPLATES = Path(__file__).with_name("templates")
PROGRAMS = ("loop.js", "metrics.js", "view.js")  # one program, in this order
LARGEST = 3_000_000  # bytes of a page; chosen: it can be sent by mail


def write_live_page(system: System, path: Path, overrides: Overrides) -> Path:
    """Write a page in which a scenario runs in a browser.

    Args:
        system: from :func:`cosim.system.prepare`, of Python FMUs.
        path: of the file, which is replaced when the new one is complete.
        overrides: parameter sets that the system was prepared with.

    Returns:
        The path.

    Raises:
        InputError: the page would be too large, cannot run the scenario, or cannot be written.
    """
    check_runnable(system)
    master = Master(system, lambda _: None)
    try:
        data = snapshot(master)
        data["alternatives"] = alternatives(system, master.table.slots, overrides)
    finally:
        master.close()
    data["modules"] = _modules(system, data)
    data["metrics"] = [metric._asdict() for metric in (*METRICS, ENERGY)]
    text = page(data)
    if (size := len(text.encode())) > LARGEST:
        raise InputError(
            f"the page would have {size / 1e6:.1f} MB, and at most {LARGEST / 1e6:g} MB are allowed: "
            "end the run earlier (--stop SECONDS)"
        )
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with atomic_write(path) as scratch:
            scratch.write_text(text, encoding="utf-8")
    except OSError as error:
        raise InputError(f"'{path}' cannot be written: {error.strerror or error}") from None
    return path


def check_replaceable(path: Path, inputs: Iterable[str | Path], overwrite: bool = False) -> None:
    """Refuse to replace a folder, an input of the page, or a file that is not such a page.

    Args:
        path: of the page.
        inputs: files, or names that need not be of files, that the page is made from.
        overwrite: whether any other file may be replaced.

    Raises:
        InputError: the path is of one of these.
    """
    if not os.path.exists(path):
        return
    if path.is_dir():
        raise InputError(f"'{path}' is a folder; give the name of a file, as '{path / 'page.html'}'")
    if any(os.path.exists(each) and path.samefile(each) for each in inputs):
        raise InputError(f"'{path}' is an input of the page; give another --out")
    begin = (TEMPLATES / "live.html").read_bytes().partition(b"$")[0]
    with path.open("rb") as file:
        if not overwrite and file.read(len(begin)) != begin:
            raise InputError(f"'{path}' exists and is not such a page; --overwrite replaces it")


def check_runnable(system: System) -> None:
    """Refuse what a browser cannot run: FMUs of others, and inputs from files.

    Raises:
        InputError: names the first.
    """
    if system.recordings:
        raise InputError("recordings: a page cannot read inputs from files; leave them out")
    for name in system.models:
        if name not in system.own:
            raise InputError(
                f"fmus.{name}: '{system.scenario.fmus[name].path}' is not an FMU of the project; "
                "a browser runs only these, which have a name without a folder"
            )


def _modules(system: System, data: Part) -> Part:
    """WebAssembly of all FMUs that the page can run."""
    options = [option for choice in data["alternatives"] for option in choice["options"]]
    names = sorted({part["module"] for part in (*data["fmus"], *options)})
    with scratch_folder() as work:
        ship = builder_options(system.scenario, native=False)
        run_builder(*ship, "--webassembly", work, "--", *names)
        return {name: json.loads((work / f"{name}.json").read_text("utf-8")) for name in names}


def page(data: Part) -> str:
    """The page of some data; scripts and styles other than its own do not run there."""
    program = "\n".join((TEMPLATES / name).read_text("utf-8") for name in PROGRAMS)
    style = (TEMPLATES / "live.css").read_text("utf-8")
    content = zlib.compress(json.dumps(data, allow_nan=False).encode(), 9)
    return Template((TEMPLATES / "live.html").read_text("utf-8")).substitute(
        policy=f"default-src 'none'; img-src data:; style-src {_hash(style)}; "
        f"script-src {_hash(program)} 'wasm-unsafe-eval'; base-uri 'none'; form-action 'none'",
        title=html.escape(data["name"]),
        description=html.escape(data["description"]),
        style=style,
        program=program,
        data=b64encode(content).decode(),
    )


def _hash(text: str) -> str:
    """What allows one script or style in a Content-Security-Policy."""
    return f"'sha256-{b64encode(hashlib.sha256(text.encode()).digest()).decode()}'"
