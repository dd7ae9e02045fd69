"""Sphinx configuration; `make docs` builds, `make test` checks every page and docstring with warnings as errors."""

import os
import re
import sys
import tomllib
from importlib.resources import files
from pathlib import Path
from typing import Any

from docutils import nodes
from sphinx.application import Sphinx
from sphinx.transforms import SphinxTransform

ROOT = Path(__file__).resolve().parents[1]
os.environ["MPLBACKEND"] = "Agg"
sys.path.insert(0, str(ROOT))

project = "cutvib_ss"
author = "The cutvib_ss developers"
copyright = author
release = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["version"]
version = ".".join(release.split(".")[:2])

extensions = [
    "myst_parser",
    "sphinx.ext.autodoc",
    "sphinx.ext.autosummary",
    "sphinx.ext.mathjax",
    "numpydoc",
]
exclude_patterns = ["_build", "adr/template.md", "blind_results_table.md"]
templates_path = ["_templates"]

myst_enable_extensions = ["dollarmath", "deflist", "colon_fence"]
myst_heading_anchors = 3

# One page a module, written from docs/_templates/autosummary/module.rst.
autosummary_generate = True
autosummary_imported_members = False
autodoc_member_order = "bysource"
autodoc_typehints = "none"  # numpydoc's Parameters say more: shape and unit
numpydoc_show_class_members = False
default_role = "code"

# Equations are drawn without a network: the files of MathJax stand beside the pages.
html_static_path = ["_static", str(files("sphinx-mathjax-offline") / "static")]
mathjax_path = "mathjax/tex-chtml.js"

html_theme = "furo"
html_css_files = ["wide.css"]
html_title = f"cutvib_ss {release}"
html_show_copyright = False


class BarsAsPrinted(SphinxTransform):
    """Leave |H| as it stands: bars mean a modulus here, and no page defines substitutions."""

    default_priority = 205  # before Sphinx and docutils look for substitutions, at 210 and 220

    def apply(self, **kwargs: Any) -> None:
        """Replace every substitution reference by the text that it was written as."""
        for reference in list(self.document.findall(nodes.substitution_reference)):
            reference.parent.replace(reference, nodes.Text(f"|{reference.astext()}|"))


def escape_bars(app: Sphinx, what: str, name: str, obj: Any, options: Any, lines: list[str]) -> None:
    """Let |A|² stand in a docstring: beside a superscript docutils would look for the end of a substitution."""
    for k, line in enumerate(lines):
        if "|" in line and not line.lstrip().startswith((">>>", "...", "+-")):
            parts = re.split(r"(``.*?``)", line)
            lines[k] = "".join(p if p.startswith("``") else re.sub(r"(?<!\\)\|", r"\\|", p) for p in parts)


def setup(app: Sphinx) -> None:
    """Register what this project adds to Sphinx."""
    app.connect("autodoc-process-docstring", escape_bars, priority=900)  # after numpydoc has laid the sections out
    app.add_transform(BarsAsPrinted)
