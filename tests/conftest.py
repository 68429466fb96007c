"""What several tests share: the built FMUs, and a scenario to vary."""

import json
import os
from pathlib import Path

import pytest

from fmus.build import build
from fmus.declare import discover

ROOT = Path(__file__).parent.parent
COMPONENTS = {component.name: component for _, component in discover()}


@pytest.fixture(autouse=True, scope="session")
def _private_cache(tmp_path_factory):
    """FMUs built by the tests do not touch the user's cache."""
    os.environ["CYBERSHIP_CACHE"] = str(tmp_path_factory.mktemp("cache"))


@pytest.fixture(scope="session")
def fmus(tmp_path_factory, _private_cache):
    """Name -> path of every FMU of the project."""
    return {path.stem: path for path in build([], tmp_path_factory.mktemp("fmus"))}


@pytest.fixture
def ellipse():
    """The content of scenarios/ellipse.json, cut to 2 s, to be varied."""
    content = json.loads((ROOT / "scenarios" / "ellipse.json").read_text())
    content["stop"] = 2.0
    content["metrics"] = {}
    return content
