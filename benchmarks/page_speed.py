"""How fast the page of a report computes: ``python -m benchmarks.page_speed REPORT.html``.

Headless Chromium opens the report, moves its first slider, and fits what is ticked. A move counts until
the page has its new layout.
"""

import argparse
import json
import os
import shutil
import subprocess
import tempfile
import time
from pathlib import Path
from typing import Any

MOVES = 101  # of the slider; chosen

LOADED = 'document.readyState === "complete" && Boolean(document.querySelector("#what-if details"))'
OPENED = 'document.querySelector("#what-if details").open = true'
READY = 'Boolean(document.querySelector("#what-if-results").dataset.milliseconds)'
MOVED = """(() => {
  const slider = document.querySelector("#what-if input[type=range]");
  const [low, high] = [Number(slider.min), Number(slider.max)], began = performance.now();
  slider.value = low + (high - low) * SHARE;
  slider.dispatchEvent(new Event("input"));
  document.documentElement.getBoundingClientRect();
  return performance.now() - began;
})()"""
FITTED = """(() => {
  const buttons = [...document.querySelectorAll("#what-if button")], began = performance.now();
  buttons.find((button) => button.textContent === "Fit this").click();
  return [performance.now() - began, document.querySelector("#what-if-status").textContent];
})()"""
PATIENCE = 60.0  # s, until the page has what is waited for; chosen


class Browser:
    """A page in headless Chromium, driven by its DevTools protocol over pipes."""

    def __init__(self, page: Path, folder: str) -> None:
        name = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))))
        self._in, out = os.pipe()
        given, self._out = os.pipe()
        options = (
            f"--headless --no-sandbox --disable-gpu --remote-debugging-pipe --user-data-dir={folder}"
        )
        command = f"exec {name} {options} 3<&{given} 4>&{out} 2>/dev/null"
        self.process = subprocess.Popen(["sh", "-c", command], pass_fds=(given, out))
        self._count, self._rest, self._session = 0, b"", {}
        target = self.ask("Target.createTarget", url=page.resolve().as_uri())["targetId"]
        session = self.ask("Target.attachToTarget", targetId=target, flatten=True)["sessionId"]
        self._session = {"sessionId": session}
        self.wait_for(LOADED)

    def wait_for(self, condition: str) -> None:
        """Wait until an expression of JavaScript is true."""
        end = time.monotonic() + PATIENCE
        while not self.evaluated(condition):
            if time.monotonic() > end:
                raise TimeoutError(condition)
            time.sleep(0.05)

    def ask(self, method: str, **params: Any) -> dict[str, Any]:
        """The result of a command."""
        self._count += 1
        message = {"id": self._count, "method": method, "params": params, **self._session}
        os.write(self._out, json.dumps(message).encode() + b"\0")
        while True:
            while b"\0" not in self._rest:
                self._rest += os.read(self._in, 1 << 16)
            text, _, self._rest = self._rest.partition(b"\0")
            answer = json.loads(text)
            if answer.get("id") == self._count:
                return answer["result"]

    def evaluated(self, expression: str) -> Any:
        """The value of an expression of JavaScript in the page."""
        found = self.ask(
            "Runtime.evaluate", expression=expression, awaitPromise=True, returnByValue=True
        )
        return found["result"].get("value")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("report", type=Path)
    page = parser.parse_args().report
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as folder:
        browser = Browser(page, folder)
        browser.evaluated(OPENED)
        browser.wait_for(READY)
        moves = sorted(browser.evaluated(MOVED.replace("SHARE", str(k / MOVES))) for k in range(MOVES))
        milliseconds, said = browser.evaluated(FITTED)
        browser.process.kill()
        browser.process.wait()
    low, median = moves[0], moves[MOVES // 2]
    print(f"a move of a slider: median {median:.1f} ms, least {low:.1f} ms of {MOVES}")
    print(f"fit: {milliseconds / 1e3:.2f} s. {said}")
    print(f"load of the machine: {os.getloadavg()[0]:.1f} on {os.cpu_count()} processors")


if __name__ == "__main__":
    main()
