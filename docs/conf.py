"""Sphinx configuration of the site; `make docs` builds it with warnings as errors."""

from __future__ import annotations

import sys
from importlib.resources import files
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))

import rps_pin

project = "rps_pin"
version = release = rps_pin.__version__
copyright = "the rps_pin developers; BSD-2-Clause"

extensions = [
    "myst_parser",
    "sphinx.ext.autodoc",
    "sphinx.ext.autosummary",
    "sphinx.ext.napoleon",
    "sphinx.ext.viewcode",
    "sphinx.ext.mathjax",
    "sphinx_copybutton",
    "docstrings",  # docs/docstrings.py
    "figures",  # docs/figures.py
    "navigation",  # docs/navigation.py
    "scenes",  # docs/scenes.py
]
exclude_patterns = ["README.md"]
templates_path = ["_templates"]

html_theme = "furo"
html_title = "rps_pin"
html_static_path = ["_static", str(files("sphinx-mathjax-offline") / "static")]
mathjax_path = "mathjax/tex-chtml.js"  # a copy in the site, not from the network
html_css_files = ["site.css"]
html_copy_source = html_show_sourcelink = False
highlight_language = "none"  # indented blocks are terminal output

# Markdown ---------------------------------------------------------------------------------------

myst_enable_extensions = ["amsmath", "colon_fence", "dollarmath"]
myst_heading_anchors = 3

# The API from docstrings ------------------------------------------------------------------------

default_role = "py:obj"  # `name` in a docstring is a link if it resolves
add_module_names = False
toc_object_entries_show_parents = "hide"
autodoc_default_options = {"members": True, "member-order": "bysource"}
autodoc_typehints_format = "short"
autodoc_class_signature = "mixed"
autodoc_type_aliases = {name: name for name in ("Array", "ArrayLike", "Closure", "Wrenches")}
autodoc_preserve_defaults = True
python_maximum_signature_line_length = 88
napoleon_google_docstring = False
napoleon_use_ivar = True
napoleon_use_rtype = False

# Links to rps_pin names that are not in the API are errors. Types in signatures and names of other
# libraries are linked if possible.
nitpicky = True
nitpick_ignore_regex = [("py:class", ".*"), ("py:.*", r"(?!rps_pin\.).*")]
