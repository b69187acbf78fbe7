# Copyright 2026 The scenario_gen authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

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
suppress_warnings = ["autoapi.python_import_resolution", "ref.python"]  # constants; Config, which each node has its own of
default_role = "code"
napoleon_google_docstring = True
napoleon_use_ivar = True

html_theme = "furo"
html_title = "scenario_gen"
html_show_sphinx = False


def escaped(_app: Any, _what: str, _name: str, _object: Any, _options: Any, lines: list[str]) -> None:
    """Escape what is mathematics in our docstrings and markup in reStructuredText: |u|, outside of backticks."""
    for k, line in enumerate(lines):
        parts = re.split(r"(`[^`]*`)", line)
        parts[::2] = [re.sub(r"(\||(?<!^)\*)", r"\\\1", part) for part in parts[::2]]
        lines[k] = "".join(parts)


def setup(app: Any) -> None:
    """Have docstrings escaped before napoleon takes them."""
    app.connect("autodoc-process-docstring", escaped, priority=100)
