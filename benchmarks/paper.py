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
    """Write `paper.html` and `paper.json`; the same input gives the same bytes."""
    folder.mkdir(parents=True, exist_ok=True)
    views: list[dict[str, Any]] = [
        {
            "index": i,
            "name": case.encounter.name,
            "road": case.road.name if case.road else "",
            "refused": refusals(case),
            "figures": claims_of(case),
        }
        for i, case in enumerate(cases)
    ]
    drawings: dict[str, Any] = {}
    for view in views:
        for k, claim in enumerate(view["figures"]):
            drawing = json.loads(claim.figure.to_json())
            drawing["layout"].pop("template", None)
            drawings[f"plot-{k}-{view['index']}"] = drawing
    document = {
        "provenance": dict(provenance),
        "cases": [
            view | {"figures": [_document(claim) for claim in view["figures"]]} for view in views
        ],
    }
    text = json.dumps(document, indent=2, ensure_ascii=False, allow_nan=False)
    write_text(folder / FIGURES, f"{text}\n")
    page = render_page(
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
    write_text(folder / PAGE, page)


def refusals(case: PaperCase) -> list[str]:
    """Return a sentence for each missing set."""
    return [
        f"{name}: {why}" if name else f"The encounter cannot be placed: {why}"
        for name, why in case.refused.items()
    ]


def _document(claim: Claim) -> dict[str, Any]:
    return {
        "figure": claim.number,
        "claim": claim.claim,
        "measured": claim.measured,
        "holds": claim.holds,
        "values": claim.values,
    }


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
    config = PipelineConfig(sampling=SamplingConfig(drivers=0.0))  # the paper's case
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
