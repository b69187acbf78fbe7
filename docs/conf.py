# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""How `make docs` builds the site: these pages, and the reference from the docstrings; nothing of the project is imported."""

import re
from typing import Any

project = "scenario_gen"
author = project_copyright = "The scenario_gen authors"
extensions = ["myst_parser", "autoapi.extension", "sphinx.ext.napoleon"]
myst_enable_extensions = ["dollarmath"]
myst_heading_anchors = 4

autoapi_dirs = ["../scenario_gen", "../msg_conventions"]
autoapi_root = "reference"
autoapi_options = ["members", "show-inheritance", "show-module-summary"]
autoapi_ignore = ["*/resources/*"]
autoapi_add_toctree_entry = False
autoapi_keep_files = False
autoapi_member_order = "bysource"
suppress_warnings = [
    "autoapi.python_import_resolution",
    "ref.python",
]  # constants; Config, which each node has its own of
default_role = "code"
napoleon_google_docstring = True
napoleon_use_ivar = True

html_theme = "furo"
html_title = "scenario_gen"
html_show_sphinx = False


def escaped(
    _app: Any, _what: str, _name: str, _object: Any, _options: Any, lines: list[str]
) -> None:
    """Escape what is mathematics in our docstrings and markup in reStructuredText: |u|, outside of backticks."""
    for k, line in enumerate(lines):
        parts = re.split(r"(`[^`]*`)", line)
        parts[::2] = [re.sub(r"(\||(?<!^)\*)", r"\\\1", part) for part in parts[::2]]
        lines[k] = "".join(parts)


def setup(app: Any) -> None:
    """Have docstrings escaped before napoleon takes them."""
    app.connect("autodoc-process-docstring", escaped, priority=100)
