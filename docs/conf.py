"""The site of the documentation: ``python -m sphinx -W -b html docs site``.

The notebooks run while it is built; ``-D nb_execution_mode=off`` leaves that out.
"""

import subprocess
import sys
from importlib.metadata import version as installed
from pathlib import Path

from sphinx.application import Sphinx

project = "cybership"
copyright = "2026, the cybership developers"  # noqa: A001 - the name that Sphinx reads
release = version = installed("cybership")
extensions = ["myst_nb", "sphinx.ext.autodoc", "sphinx.ext.napoleon", "sphinx.ext.viewcode"]
html_theme = "furo"
html_static_path = ["_static"]
html_css_files = ["site.css"]  # pages as wide as lines of code
html_title = f"cybership {release}"
exclude_patterns = ["studies/**/results.json"]
source_suffix = {".md": "myst-nb"}
nb_execution_mode = "force"
nb_execution_in_temp = True  # what a notebook writes goes with it
nb_execution_raise_on_error = True
nb_execution_timeout = 600  # s for a cell; chosen: far above the seconds that one takes
nb_merge_streams = True
myst_enable_extensions = ["dollarmath", "colon_fence"]
myst_heading_anchors = 4
autodoc_member_order = "alphabetical"
autodoc_typehints = "description"
# Links to files of the repository that are no pages: tests/test_docs.py sees that they exist.
suppress_warnings = ["myst.xref_missing"]


def write_live_page(app: Sphinx, exception: Exception | None) -> None:
    """Write the page that the front page embeds, in which a scenario runs."""
    if exception is None and app.builder.name == "html":
        page = Path(app.outdir, "_static", "ellipse.html")
        options = ["ellipse", "--stop", "60", "--out", str(page), "--overwrite"]
        subprocess.run([sys.executable, "-m", "cosim.live", *options], check=True, cwd=app.outdir)


def setup(app: Sphinx) -> None:
    app.connect("build-finished", write_live_page)
