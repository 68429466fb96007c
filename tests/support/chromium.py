"""A page in headless Chromium without network."""

import base64
import json
import os
import re
import shutil
import subprocess

import pytest

from .events import once_there

NAMES = ("chromium", "chromium-browser", "google-chrome")
BROWSER = next(filter(None, map(shutil.which, NAMES)), None)

NO_BROWSER = f"no {', '.join(NAMES[:-1])} or {NAMES[-1]} on the PATH"


def command_of(folder):
    """Headless Chromium with its profile in a folder."""
    return [
        BROWSER,
        "--headless",
        "--disable-gpu",
        "--hide-scrollbars",
        "--host-resolver-rules=MAP * ~NOTFOUND",
        f"--user-data-dir={folder / 'profile'}",
        *(["--no-sandbox"] if getattr(os, "geteuid", lambda: 1)() == 0 else []),
    ]


def opened(page, folder, *options, milliseconds=5000):
    """What Chromium prints for a page; nothing may be written to its console.

    Args:
        page: the file.
        folder: for Chromium's profile.
        options: of Chromium, for instance ``--dump-dom``.
        milliseconds: virtual time that the page gets.
    """
    if BROWSER is None:
        pytest.skip(NO_BROWSER)
    command = [
        *command_of(folder),
        "--enable-logging=stderr",
        f"--virtual-time-budget={milliseconds}",
        *options,
        page.as_uri(),
    ]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    stated = re.findall(r".*CONSOLE.*", done.stderr)
    assert not stated, stated
    return done.stdout


class Tab:
    """A page in Chromium that is driven over the DevTools protocol, through pipes; a context manager.

    Attributes:
        console: what was written to the console, and errors that nothing caught.
    """

    def __init__(self, page, folder):
        if BROWSER is None:
            pytest.skip(NO_BROWSER)
        self.console = []
        self._count = 0
        to_browser, self._to = os.pipe()
        self._from, from_browser = os.pipe()

        def at_known_places():  # the protocol demands 3 and 4
            held = os.dup(to_browser), os.dup(from_browser)
            for place, pipe in zip((3, 4), held, strict=True):
                os.dup2(pipe, place)

        command = [*command_of(folder), "--remote-debugging-pipe", "about:blank"]
        self._process = subprocess.Popen(
            command, stderr=subprocess.DEVNULL, close_fds=False, preexec_fn=at_known_places
        )
        os.close(to_browser)
        os.close(from_browser)
        self._messages = self._received()
        target = self.send("Target.createTarget", url="about:blank")["targetId"]
        self._session = self.send("Target.attachToTarget", targetId=target, flatten=True)["sessionId"]
        for domain in ("Runtime", "Page", "Log"):
            self.send(f"{domain}.enable", session=True)
        self.send("Page.navigate", session=True, url=page.as_uri())

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.send("Browser.close")
        self._process.wait(timeout=60)
        os.close(self._to)
        os.close(self._from)

    def _received(self):
        kept = b""
        while part := os.read(self._from, 1 << 20):
            *whole, kept = (kept + part).split(b"\0")
            yield from map(json.loads, whole)
        raise EOFError("Chromium has ended")

    def send(self, method, session=False, **parameters):
        """The result of a method of the protocol."""
        self._count += 1
        message = {"id": self._count, "method": method, "params": parameters}
        message |= {"sessionId": self._session} if session else {}
        os.write(self._to, json.dumps(message).encode() + b"\0")
        for answer in self._messages:
            if answer.get("method") in (
                "Runtime.consoleAPICalled",
                "Runtime.exceptionThrown",
                "Log.entryAdded",
            ):
                self.console.append(answer["params"])
            if answer.get("id") == self._count:
                assert "error" not in answer, answer
                return answer["result"]
        return None

    def evaluate(self, expression):
        """The value of an expression of the page, of a promise its result."""
        given = {"expression": expression, "awaitPromise": True, "returnByValue": True}
        answer = self.send("Runtime.evaluate", session=True, **given)
        assert "exceptionDetails" not in answer, answer["exceptionDetails"]
        return answer["result"].get("value")

    def wait(self, condition):
        """Wait until a condition of the page is true."""
        once_there(lambda: self.evaluate(condition), 0.05)

    def press(self, key):
        """Press a key of one sign."""
        for kind in ("keyDown", "keyUp"):
            self.send(
                "Input.dispatchKeyEvent",
                session=True,
                type=kind,
                key=key,
                text=key if kind == "keyDown" else "",
            )

    def size(self, width, height):
        """Give the page a size [pixels]; below 600 it is that of a phone."""
        size = {"width": width, "height": height, "deviceScaleFactor": 1, "mobile": width < 600}
        self.send("Emulation.setDeviceMetricsOverride", session=True, **size)

    def screenshot(self, file, width, height):
        self.size(width, height)
        file.write_bytes(base64.b64decode(self.send("Page.captureScreenshot", session=True)["data"]))
