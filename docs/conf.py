# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""How `make docs` builds the site: the pages, and an API page for each public name.

The sources are parsed, not imported.
"""

import ast
from functools import cache
from pathlib import Path
import re
import subprocess
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
PACKAGE = "scenario_gen"
VERSION = re.search(r'__version__ = "(.+)"', (ROOT / PACKAGE / "__init__.py").read_text())[1]

# Interfaces for plugins, planners and criteria. They are no names of the package itself.
INTERFACES = {
    "scenario_gen.closed_loop.criteria": ["Criterion"],
    "scenario_gen.closed_loop.drive": ["Drive"],
    "scenario_gen.closed_loop.ego": ["Command", "EgoState"],
    "scenario_gen.closed_loop.environment": ["DriveEnv"],
    "scenario_gen.closed_loop.simulation": ["Observation", "Planner", "Task"],
    "scenario_gen.logs": ["LogFormat", "RawLog", "Rows", "Segment"],
    "scenario_gen.method.evaluation": ["MetricGroup", "Samples"],
    "scenario_gen.method.routing": ["MakePlanner", "Plan", "Planner", "PoseQuery"],
    "scenario_gen.output.exchange": ["Case", "ExportFormat", "Exported"],
    "scenario_gen.roads": ["Arm", "DrawRoad", "Plan", "draw_plan"],
    "scenario_gen.situation": ["Situation"],
    "scenario_gen.types": ["Dynamics", "TypeLimits", "VehicleType"],
}

project = PACKAGE
author = project_copyright = "The scenario_gen authors"
version = release = VERSION
extensions = ["myst_parser", "autoapi.extension", "sphinx.ext.napoleon"]
myst_enable_extensions = ["dollarmath"]
myst_heading_anchors = 4
default_role = "code"
napoleon_google_docstring = True
napoleon_use_ivar = True
python_use_unqualified_type_names = True
python_maximum_signature_line_length = 99

html_theme = "furo"
html_title = f"{PACKAGE} {VERSION}"
html_show_sphinx = False
html_copy_source = False
# Pages link to their source where the checkout comes from a host that can edit files.
REMOTE = subprocess.run(
    ["git", "config", "--get", "remote.origin.url"],
    cwd=ROOT,
    capture_output=True,
    text=True,
    check=False,
).stdout
HOSTED = re.match(
    r"(?:https://|git@)((?:github|gitlab)\.com|bitbucket\.org)[:/](.+?)(?:\.git)?$", REMOTE.strip()
)
if HOSTED:
    html_theme_options = {
        "source_repository": f"https://{HOSTED[1]}/{HOSTED[2]}",
        "source_branch": "main",
        "source_directory": "docs/",
    }


def source_file(module: str) -> Path:
    """Return a module's file; of the package itself the stub, which lists the public names."""
    path = ROOT.joinpath(*module.split("."))
    if module == PACKAGE:
        return path / "__init__.pyi"
    return path / "__init__.py" if path.is_dir() else path.with_suffix(".py")


@cache
def imports(module: str) -> dict[str, tuple[str, str]]:
    """Return (module, name) of each name that a module imports from the package."""
    return {
        alias.asname or alias.name: (node.module, alias.name)
        for node in ast.parse(source_file(module).read_text(encoding="utf-8")).body
        if isinstance(node, ast.ImportFrom) and (node.module or "").startswith(PACKAGE)
        for alias in node.names
    }


def definition(module: str, name: str) -> list[str]:
    """Return the modules through which a name is imported, the one that defines it last."""
    modules = [module]
    while name in (imported := imports(modules[-1])):
        module, name = imported[name]
        modules.append(module)
    return modules


def packages(module: str) -> list[str]:
    """Return a module and the packages that contain it."""
    parts = module.split(".")
    return [".".join(parts[:count]) for count in range(1, len(parts) + 1)]


SHOWN = {PACKAGE: list(imports(PACKAGE)), **INTERFACES}
CHAINS = {(module, name): definition(module, name) for module in SHOWN for name in SHOWN[module]}
PAGES = {page for module in SHOWN for page in packages(module)}  # modules with a page
PARSED = {str(source_file(module)) for chain in CHAINS.values() for module in chain} | {
    str(source_file(page)) for page in PAGES
}
# The public page of each name, by the module that defines it.
PUBLIC = {(chain[-1], name): module for (module, name), chain in reversed(CHAINS.items())}

autoapi_dirs = ["../scenario_gen"]
autoapi_root = "reference"
autoapi_own_page_level = "function"
autoapi_options = [
    "members",
    "imported-members",
    "inherited-members",
    "show-inheritance",
    "show-module-summary",
]
autoapi_file_patterns = ["*.pyi", "*.py"]
autoapi_ignore = sorted(
    str(path) for path in (ROOT / PACKAGE).rglob("*.py*") if str(path) not in PARSED
)
autoapi_add_toctree_entry = False
autoapi_keep_files = False
autoapi_member_order = "bysource"
suppress_warnings = ["autoapi.python_import_resolution", "ref.python"]


def skip(_app: Any, what: str, name: str, _object: Any, skipped: bool, _options: Any) -> bool:
    """Skip modules and names that are not public."""
    if what in {"package", "module"}:
        return name not in PAGES
    module, _, last = name.rpartition(".")
    if module in PAGES or str(source_file(module)) in PARSED:
        return last not in SHOWN.get(module, [])
    return skipped


def resolve(app: Any, env: Any, node: Any, content: Any) -> Any:
    """Link a name to its public page, by whichever module an annotation or a page names."""
    module, _, name = node.get("reftarget", "").rpartition(".")
    if node.get("refdomain") != "py" or not source_file(module).is_file():
        return None
    public = PUBLIC.get((definition(module, name)[-1], name))
    return public and env.get_domain("py").resolve_xref(
        env, node["refdoc"], app.builder, "obj", f"{public}.{name}", node, content
    )


def escaped(
    _app: Any, _what: str, _name: str, _object: Any, _options: Any, lines: list[str]
) -> None:
    """Escape mathematics that is markup in reStructuredText: |u|, outside of backticks."""
    for k, line in enumerate(lines):
        parts = re.split(r"(`[^`]*`)", line)
        parts[::2] = [re.sub(r"(\||(?<!^)\*)", r"\\\1", part) for part in parts[::2]]
        lines[k] = "".join(parts)


def hide_edit_link(_app: Any, page: str, _template: str, context: Any, _doctree: Any) -> None:
    """Hide the edit link of generated pages."""
    if page.startswith(autoapi_root):
        context["page_source_suffix"] = ""


def parameter_lines(match: re.Match[str]) -> str:
    """Return a signature's parameters as blocks: they are no list of definitions."""
    lines = re.sub("<(/?)dd>", lambda tag: "</span>" if tag[1] else BLOCK, match[1])
    return f"{BLOCK}{lines}</span>"


BLOCK = '<span style="display: block; margin-left: 1em">'
REPAIRS = (
    (r' role="heading">', ' role="heading" aria-level="2">'),
    (r'^<div id="search-results">', '<h1>Search</h1><div id="search-results">'),
    (r"<pre>", '<pre tabindex="0">'),
    (r'<div class="table-wrapper', '<div tabindex="0" class="table-wrapper'),
    (r'<aside class="sidebar-drawer', '<aside aria-label="Site" class="sidebar-drawer'),
    (r'<aside class="toc-drawer', '<aside aria-label="Page" class="toc-drawer'),
    (r"<dl>\n((?:<dd>.*?</dd>\n?)+)</dl>", parameter_lines),
)


def repair(app: Any, _error: Any) -> None:
    """Repair what keeps the theme's pages from people who use a keyboard or a screen reader."""
    for path in Path(app.outdir).rglob("*.html"):
        text = path.read_text(encoding="utf-8")
        for pattern, replacement in REPAIRS:
            text = re.sub(pattern, replacement, text, flags=re.MULTILINE)
        path.write_text(text, encoding="utf-8")


def setup(app: Any) -> None:
    """Connect the functions above; docstrings are escaped before napoleon reads them."""
    app.connect("autodoc-process-docstring", escaped, priority=100)
    app.connect("autoapi-skip-member", skip)
    app.connect("missing-reference", resolve)
    app.connect("html-page-context", hide_edit_link)
    app.connect("build-finished", repair)
