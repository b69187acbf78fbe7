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

"""One page and one JSON file with the paper's figures, their claims and what is measured."""

from collections.abc import Mapping, Sequence
from importlib.resources import files
import json
from pathlib import Path
from typing import Any

import jinja2
from markupsafe import Markup
from plotly.offline import get_plotlyjs

from scenario_gen.evaluation.policy import content_policy
from scenario_gen.folders import Kind, write_text
from scenario_gen.reproduce.claims import Claim, claims_of
from scenario_gen.reproduce.measure import PaperCase

PAGE, FIGURES = "reproduce.html", "reproduce.json"
SETTINGS = (
    "a grid of 1000 × 1000 cells, straight lane and T-intersection, 200 sweeps of the sticky HDP-HMM on positions and speeds, "
    "RRT*-Connect with step 5, σ_ω = σ_f = 10 and l = 100 cells, a cubic mean."
)


def write_page(folder: Path, cases: Sequence[PaperCase], *, quality: Sequence[str], provenance: Mapping[str, str]) -> None:
    """Write `reproduce.html` and `reproduce.json` to `folder`; the same input gives the same bytes."""
    folder.mkdir(parents=True, exist_ok=True)
    claims = [claims_of(case) for case in cases]
    document = {
        "provenance": dict(provenance),
        "cases": [_figures(case, found) for case, found in zip(cases, claims, strict=True)],
    }
    write_text(folder / FIGURES, json.dumps(document, indent=2, ensure_ascii=False, allow_nan=False) + "\n")
    write_text(folder / PAGE, _render(cases, claims, quality, provenance))


def _is_reproduced(folder: Path) -> bool:
    """Say whether a folder without a marker is what `write_page` left there: these names, and figures with their provenance."""
    if {path.name for path in folder.iterdir()} != {PAGE, FIGURES}:
        return False
    try:
        document = json.loads((folder / FIGURES).read_text(encoding="utf-8"))
        cases = [set(case) for case in document["cases"]]
    except (OSError, ValueError, KeyError, TypeError):
        return False
    return set(document) == {"provenance", "cases"} and all(c == {"encounter", "road", "refused", "figures"} for c in cases)


REPRODUCED = Kind("reproduced", _is_reproduced)


def refusals(case: PaperCase) -> list[str]:
    """Say what is missing, and why."""
    return [f"{name}: {why}" if name else f"The encounter cannot be placed: {why}" for name, why in case.refused.items()]


def _figures(case: PaperCase, claims: Sequence[Claim]) -> dict[str, Any]:
    return {
        "encounter": case.encounter.name,
        "road": case.road.name if case.road else None,
        "refused": refusals(case),
        "figures": [
            {"figure": c.number, "claim": c.claim, "measured": c.measured, "holds": c.holds, "values": c.values} for c in claims
        ],
    }


def _render(
    cases: Sequence[PaperCase], claims: Sequence[Sequence[Claim]], quality: Sequence[str], provenance: Mapping[str, str]
) -> str:
    assets = files("scenario_gen.evaluation") / "assets"
    template = jinja2.Environment(
        autoescape=True, trim_blocks=True, lstrip_blocks=True, undefined=jinja2.StrictUndefined
    ).from_string((assets / "reproduce.html.j2").read_text(encoding="utf-8"))
    views = [
        {
            "index": i,
            "name": case.encounter.name,
            "road": case.road.name if case.road else "",
            "refused": refusals(case),
            "figures": found,
        }
        for i, (case, found) in enumerate(zip(cases, claims, strict=True))
    ]
    drawings = {
        f"plot-{k}-{i}": json.loads(claim.figure.to_json()) for i, found in enumerate(claims) for k, claim in enumerate(found)
    }
    for drawing in drawings.values():
        drawing["layout"].pop("template", None)
    scripts = [get_plotlyjs(), (assets / "reproduce.js").read_text(encoding="utf-8")]
    return template.render(
        cases=views,
        quality=quality,
        provenance=provenance,
        settings=SETTINGS,
        css=Markup((assets / "report.css").read_text(encoding="utf-8")),
        policy=Markup(content_policy(scripts)),
        scripts=[Markup(script) for script in scripts],
        data=Markup(json.dumps(drawings, separators=(",", ":"), allow_nan=False).replace("<", "\\u003c")),
    )
