# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Self-contained HTML pages that work offline, and XML documents, by templates.

A content security policy allows only our own scripts, by their hashes. Names from a log therefore
stay text even if escaping were forgotten: no other script element, no event handler, no
`javascript:` URL and no `eval` runs, and nothing is loaded from a network.
"""

from base64 import b64encode
from collections.abc import Callable, Sequence
from hashlib import sha256
from importlib.resources import files
import json
from pathlib import Path
from typing import Any

import jinja2
from markupsafe import Markup

from scenario_gen.base.errors import printable_lines
from scenario_gen.numerics.kernel_cache import root
from scenario_gen.types import formatted


def render_page(
    template: str,
    scripts: Sequence[str],
    data: Any,
    *,
    libraries: Sequence[str] = (),
    folder: Path | None = None,
    **values: Any,
) -> str:
    """Return a page as text; the same input gives the same bytes.

    Args:
        template: name of a Jinja template among the assets.
        scripts: names of scripts among the assets; they run in this order, after the libraries.
        data: input of the scripts, embedded as JSON; all numbers are finite.
        libraries: texts of third-party scripts.
        folder: with further templates and scripts.
        **values: further variables of the template.
    """

    def asset(name: str) -> str:
        if folder is not None and (folder / name).is_file():
            return (folder / name).read_text(encoding="utf-8")
        return _asset(name)

    environment = _environment(asset)
    environment.filters["estimate"] = formatted
    texts = [*libraries, *map(asset, scripts)]
    return environment.get_template(template).render(
        css=Markup(asset("report.css")),
        policy=Markup(content_policy(texts)),
        scripts=[Markup(text) for text in texts],
        data=Markup(
            json.dumps(data, separators=(",", ":"), allow_nan=False).replace("<", "\\u003c")
        ),
        **values,
    )


def render_xml(template: str, **values: Any) -> str:
    """Return an XML document by a template; control characters, which XML lacks, are escaped."""
    environment = xml_environment(lambda value: printable_lines(str(value)))
    return environment.get_template(template).render(**values) + "\n"


def xml_environment(as_text: Callable[[Any], str]) -> jinja2.Environment:
    """Return the environment of templates whose values `as_text` converts."""
    environment = _environment(_asset)
    environment.finalize = as_text
    return environment


def _asset(name: str) -> str:
    return (files("scenario_gen.output.report") / "assets" / name).read_text(encoding="utf-8")


def _environment(asset: Callable[[str], str]) -> jinja2.Environment:
    return jinja2.Environment(
        loader=jinja2.FunctionLoader(asset),
        bytecode_cache=jinja2.FileSystemBytecodeCache(str(root())),
        autoescape=True,
        trim_blocks=True,
        lstrip_blocks=True,
        undefined=jinja2.StrictUndefined,
    )


def content_policy(scripts: Sequence[str]) -> str:
    """Return the policy of a page with these inline scripts, each without its tags.

    Inline styles are allowed, as widths of bars and colours of vehicles are style attributes.
    """
    hashes = " ".join(
        f"'sha256-{b64encode(sha256(text.encode('utf-8')).digest()).decode('ascii')}'"
        for text in scripts
    )
    return (
        f"default-src 'none'; script-src {hashes}; style-src 'unsafe-inline'; "
        "img-src data: blob:; font-src data:; base-uri 'none'; form-action 'none'"
    )
