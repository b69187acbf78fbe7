# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Pages that hold everything they need and open offline.

Nothing runs in them but the scripts that we put there ourselves, named by their hashes. So a name out of a log stays text,
whatever it looks like, even where escaping it were forgotten: no script element, no event handler and no `javascript:` address
is run, `eval` is not to be had, and nothing is asked of any network.
"""

from base64 import b64encode
from collections.abc import Sequence
from hashlib import sha256
from importlib.resources import files
import json
from pathlib import Path
from typing import Any

import jinja2
from markupsafe import Markup

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
        scripts: names of scripts among the assets, in the order in which they run, after the libraries.
        data: what the scripts draw, put into the page as JSON; all numbers finite.
        libraries: scripts of others, as text.
        folder: of further templates and scripts.
        **values: what else the template asks for.
    """
    assets = files("scenario_gen.output.report") / "assets"

    def asset(name: str) -> str:
        own = folder / name if folder is not None else None
        return (own if own is not None and own.is_file() else assets / name).read_text(
            encoding="utf-8"
        )

    environment = jinja2.Environment(
        loader=jinja2.FunctionLoader(asset),
        autoescape=True,
        trim_blocks=True,
        lstrip_blocks=True,
        undefined=jinja2.StrictUndefined,
    )
    environment.filters["estimate"] = lambda value, unit="", bounds=True, cap=None: formatted(
        value, unit, bounds=bounds, cap=cap
    )
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


def content_policy(scripts: Sequence[str]) -> str:
    """Return the policy of a page with these inline scripts, each given as it stands between its tags.

    Styles stay free ('unsafe-inline'): widths of bars and colours of vehicles are style attributes.
    """
    hashes = " ".join(
        f"'sha256-{b64encode(sha256(text.encode('utf-8')).digest()).decode('ascii')}'"
        for text in scripts
    )
    return (
        f"default-src 'none'; script-src {hashes}; style-src 'unsafe-inline'; img-src data: blob:; font-src data:; "
        "base-uri 'none'; form-action 'none'"
    )
