# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The paper's figures 2 to 5 on its own settings, each beside its claim and what we measure: one page and one JSON file.

`--out` names their folder (out/paper), `--count` the scenarios of each case (50), `--log` other files than the bundled cases,
`--seed` the seed (7).
"""

from collections.abc import Callable, Mapping, Sequence
import json
from pathlib import Path
import sys
from typing import Any

from plotly.offline import get_plotlyjs

from benchmarks._paper_chain import ROADS
from benchmarks._paper_claims import Claim, claims_of
from benchmarks._paper_measure import PaperCase, run_case
from benchmarks._size import sized
from benchmarks.row import higher, Row
from scenario_gen.base.errors import RefusedError
from scenario_gen.base.folders import Kind, replaced_folder, write_text
from scenario_gen.base.parameters import flatten
from scenario_gen.logs import bundled, CASES, read_log
from scenario_gen.method.sampling import SamplingConfig
from scenario_gen.output.report.html import render_page
from scenario_gen.output.results import provenance_of
from scenario_gen.pipeline import PipelineConfig

SEED = 7
PAGE, FIGURES = "paper.html", "paper.json"
REPRODUCED = Kind("reproduced")
ASSETS = Path(__file__).parent / "assets"
VERDICTS = {True: ", as claimed", False: ", not as claimed", None: ""}
SETTINGS = (
    "a grid of 1000 × 1000 cells, straight lane and T-intersection, 200 sweeps of the sticky HDP-HMM on positions and speeds, "
    "RRT*-Connect with step 5, σ_ω = σ_f = 10 and l = 100 cells, a cubic mean."
)


def write_page(
    folder: Path,
    cases: Sequence[PaperCase],
    *,
    quality: Sequence[str],
    provenance: Mapping[str, str],
) -> None:
    """Write `paper.html` and `paper.json` to `folder`; the same input gives the same bytes."""
    folder.mkdir(parents=True, exist_ok=True)
    claims = [claims_of(case) for case in cases]
    document = {
        "provenance": dict(provenance),
        "cases": [_figures(case, found) for case, found in zip(cases, claims, strict=True)],
    }
    write_text(
        folder / FIGURES,
        json.dumps(document, indent=2, ensure_ascii=False, allow_nan=False) + "\n",
    )
    write_text(folder / PAGE, _render(cases, claims, quality, provenance))


def refusals(case: PaperCase) -> list[str]:
    """Say what is missing, and why."""
    return [
        f"{name}: {why}" if name else f"The encounter cannot be placed: {why}"
        for name, why in case.refused.items()
    ]


def _figures(case: PaperCase, claims: Sequence[Claim]) -> dict[str, Any]:
    return {
        "encounter": case.encounter.name,
        "road": case.road.name if case.road else None,
        "refused": refusals(case),
        "figures": [
            {
                "figure": c.number,
                "claim": c.claim,
                "measured": c.measured,
                "holds": c.holds,
                "values": c.values,
            }
            for c in claims
        ],
    }


def _render(
    cases: Sequence[PaperCase],
    claims: Sequence[Sequence[Claim]],
    quality: Sequence[str],
    provenance: Mapping[str, str],
) -> str:
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
        f"plot-{k}-{i}": json.loads(claim.figure.to_json())
        for i, found in enumerate(claims)
        for k, claim in enumerate(found)
    }
    for drawing in drawings.values():
        drawing["layout"].pop("template", None)
    return render_page(
        "paper.html.j2",
        ("paper.js",),
        drawings,
        libraries=(get_plotlyjs(),),
        folder=ASSETS,
        cases=views,
        quality=quality,
        provenance=provenance,
        settings=SETTINGS,
    )


def reproduce(
    logs: Sequence[Sequence[Path]],
    out: Path,
    *,
    count: int,
    seed: int,
    report: Callable[[str], None] = lambda line: None,
) -> list[PaperCase]:
    """Draw the paper's figures 2 to 5 for every encounter of `logs`, with what we measure for them, to one page and JSON.

    Args:
        logs: groups of files, each read as one log.
        out: folder of the page.
        count: scenarios per encounter and arm (the paper: 50).
        seed: same seed, same bytes.
        report: called with each line of what the encounters came to.

    Raises:
        InputError: a log cannot be read, or `out` holds something else.
        RefusedError: not one encounter could be placed on a road of the paper; the page is written all the same.
    """
    config = PipelineConfig(sampling=SamplingConfig(variety="narrow"))  # the paper's variety
    files = [path for group in logs for path in group]
    with replaced_folder(out, REPRODUCED, files) as partial:
        found = [read_log(list(group), config.log) for group in logs]
        cases = [
            run_case(encounter, count=count, seed=seed)
            for log in found
            for encounter in log.encounters
        ]
        facts = provenance_of(files, seed, count, ROADS, config)
        own = {
            name: value for name, value in facts.items() if name not in flatten(config)
        }  # the paper's parameters are fixed
        write_page(
            partial,
            cases,
            quality=[line for log in found for line in log.quality.lines()],
            provenance=own,
        )
    for case in cases:
        report(f"{case.encounter.name} on {case.road.name if case.road else 'no road'}")
        for line in refusals(case):
            report(f"  {line}")
        for claim in claims_of(case):
            report(f"  figure {claim.number}{VERDICTS[claim.holds]}: {claim.measured}")
    report(f"page: {out / PAGE}")
    if not any(case.arms for case in cases):
        raise RefusedError(
            "no encounter could be placed on a road of the paper; the page says why"
        )
    return cases


def run(
    out: str = "out/paper", count: int | None = None, log: Sequence[str] = (), seed: int = SEED
) -> list[Row]:
    """Measure the bundled cases, or a log, on the paper's settings, and write the page and its figures to `out`."""
    count = count or sized(50, quick=2)
    logs = [[Path(name) for name in log]] if log else [[bundled(case)] for case in CASES]
    cases = reproduce(
        logs, Path(out), count=count, seed=seed, report=lambda line: print(line, file=sys.stderr)
    )
    rows = []
    for case in cases:
        holds = [claim.holds for claim in claims_of(case) if claim.holds is not None]
        rows.append(
            higher(
                f"claims of the paper that hold, {case.encounter.name}",
                float(sum(holds)),
                f"of {len(holds)}",
            )
        )
    return rows
