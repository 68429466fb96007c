"""A page in headless Chromium without network."""

import os
import re
import shutil
import subprocess

import pytest

NAMES = ("chromium", "chromium-browser", "google-chrome")
BROWSER = next(filter(None, map(shutil.which, NAMES)), None)


def opened(page, folder, *options, milliseconds=5000):
    """What Chromium prints for a page; nothing may be written to its console.

    Args:
        page: the file.
        folder: for Chromium's profile.
        options: of Chromium, for instance ``--dump-dom``.
        milliseconds: virtual time that the page gets.
    """
    if BROWSER is None:
        pytest.skip(f"no {', '.join(NAMES[:-1])} or {NAMES[-1]} on the PATH")
    command = [
        BROWSER,
        "--headless",
        "--disable-gpu",
        "--hide-scrollbars",
        "--enable-logging=stderr",
        "--host-resolver-rules=MAP * ~NOTFOUND",
        f"--virtual-time-budget={milliseconds}",
        f"--user-data-dir={folder / 'profile'}",
        *(["--no-sandbox"] if getattr(os, "geteuid", lambda: 1)() == 0 else []),
        *options,
        page.as_uri(),
    ]
    done = subprocess.run(command, capture_output=True, text=True, timeout=120, check=False)
    assert done.returncode == 0, done.stderr
    assert not re.findall(r".*CONSOLE.*", done.stderr)
    return done.stdout
