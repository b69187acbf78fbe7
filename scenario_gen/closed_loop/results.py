# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The results of a planner test in one folder: JSON, JUnit's XML and a page.

The same drives give the same bytes.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from itertools import zip_longest
import json
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from scenario_gen.base.folders import Kind, write_text
from scenario_gen.base.parameters import values_of
from scenario_gen.closed_loop.blind import BlindRate
from scenario_gen.closed_loop.comparison import Comparison
from scenario_gen.closed_loop.config import ClosedLoopConfig
from scenario_gen.closed_loop.mutants import MutationScore
from scenario_gen.closed_loop.origin import Trial
from scenario_gen.closed_loop.trials import Outcome, passed_of, rates
from scenario_gen.output.report.data import (
    FRAME_PERIOD_S,
    lights_of_all,
    MAX_FRAMES_COUNT,
    pack,
    road_data,
    states,
)
from scenario_gen.output.report.html import render_page, render_xml

JSON, JUNIT, PAGE = "drives.json", "junit.xml", "drives.html"
DRIVEN = Kind("driven")
MAX_REPLAYS_COUNT = 100
"""The page replays the worst drives; its table lists all."""


@dataclass(frozen=True, eq=False)
class Drives:
    """The results of a planner.

    Attributes:
        outcomes: the outcomes of the drives.
        planner: the planner's name.
        config: the parameters of the drives.
        trials: the trials; without them there is no page.
        broken: sentences on the thresholds that are not met, and on the comparison if the planner
            is worse.
        baseline: outcomes of the non-reactive baseline.
        blind: how the best blind planner does in the same scenarios.
        comparison: the comparison with an earlier planner.
        mutants: how many faults of the planner the scenarios catch.
    """

    outcomes: Sequence[Outcome]
    planner: str
    config: ClosedLoopConfig
    trials: Sequence[Trial] = ()
    broken: Sequence[str] = ()
    baseline: Sequence[Outcome] = ()
    blind: BlindRate | None = None
    comparison: Comparison | None = None
    mutants: MutationScore | None = None

    @cached_property
    def rows(self) -> list[dict[str, Any]]:
        """The drives as JSON's types: name and origin of each scenario, and the verdict."""
        decisions = [trial.scenario.facts.decision for trial in self.trials]
        return [
            {
                "name": outcome.name,
                "encounter": outcome.origin.encounter,
                "scenario": outcome.origin.digest,
                "copy_of": outcome.origin.copy_of or None,
                "decision": decision and decision.document(),
                **outcome.verdict.document(),
            }
            for outcome, decision in zip_longest(self.outcomes, decisions)
        ]

    @cached_property
    def table(self) -> pd.DataFrame:
        """The drives, a row each; the values of a decision are columns."""
        return pd.json_normalize(self.rows)

    def __repr__(self) -> str:
        name = self.planner.rpartition(":")[2]
        return f"Drives({name} passes {passed_of(self.outcomes)})"

    def to_dataframe(self) -> pd.DataFrame:
        """Return a copy of `table`."""
        return self.table.copy()

    def by_severity(self) -> list[int]:
        """Return the indices of the outcomes, the worst first."""
        severity = [outcome.verdict.severity for outcome in self.outcomes]
        return sorted(range(len(severity)), key=lambda k: (*(-each for each in severity[k]), k))

    def notes(self) -> list[str]:
        """Return sentences that qualify the figures."""
        if not self.rows:
            return []
        observation = self.config.observation
        messages = (
            self._origin_note(),
            self._outcomes_note(),
            self._copies_note(),
            self._baseline_note(),
            self.blind,
            "" if observation.is_perfect else f"observation of the others: {observation}",
            self.comparison and self.comparison.sentence(),
            self.mutants,
            self._faults_note(),
        )
        return [str(message) for message in messages if message]

    def _origin_note(self) -> str:
        encounters = sorted({*self.table.encounter} - {""})
        if len(encounters) == 1:
            return f"intervals cover this one encounter only ({encounters[0]})"
        if encounters:
            return (
                f"intervals cover encounters drawn like these {len(encounters)}: drives from one "
                "encounter are similar"
            )
        return ""

    def _outcomes_note(self) -> str:
        """Return how many drives pass with each outcome of the decisions, if there are several."""
        drawn = self.table.filter(like="decision.").columns.tolist()
        if not drawn or self.table["decision.outcome"].nunique() == 1:
            return ""
        passed = self.table.groupby("decision.outcome", sort=False).passed.agg(["sum", "size"])
        counts = [f"{name}: {hits} of {of}" for name, hits, of in passed.itertuples()]
        shares = self.table.groupby(["encounter", *drawn]).passed.mean().reset_index()
        share = np.average(shares.passed, weights=shares["decision.probability"])
        return (
            f"passed by outcome of the decision: {', '.join(counts)}; "
            f"{share:.0%} weighted by its probability"
        )

    def _copies_note(self) -> str:
        copies = self.table.copy_of.count()
        if not copies:
            return ""
        of_all = f"{copies} of {len(self.rows)} scenarios"
        return f"{of_all} are copies of another scenario from the same encounter"

    def _baseline_note(self) -> str:
        if not self.baseline:
            return ""
        passed = Drives(self.baseline, "", self.config).table.groupby("encounter").passed
        counts = [
            f"{hits} of {of} from {name}"
            for name, hits, of in passed.agg(["sum", "size"]).itertuples()
            if name
        ]
        by_encounter = f": {', '.join(counts)}" if 1 < len(counts) <= 12 else ""
        return f"the non-reactive baseline passes {passed_of(self.baseline)}{by_encounter}"

    def _faults_note(self) -> str:
        faulty = [outcome for outcome in self.outcomes if outcome.drive.faults]
        if not faulty:
            return ""
        step, fault = faulty[0].drive.faults[0]
        time = step * self.config.step
        return (
            f"{len(faulty)} drives with faulty commands; the first in scenario {faulty[0].name} "
            f"at {time:.1f} s: {fault}"
        )

    def document(self) -> dict[str, Any]:
        """Return all verdicts and their summary as JSON's types."""
        parts = {"best_blind": self.blind, "against": self.comparison, "mutants": self.mutants}
        return {
            "planner": self.planner,
            **self.config.facts(),
            "parameters": values_of(self.config),
            "summary": {name: rate.document() for name, rate in rates(self.outcomes).items()},
            "baseline_pass": passed_of(self.baseline).document() if self.baseline else None,
            **{name: part and part.document() for name, part in parts.items()},
            "notes": self.notes(),
            "drives": self.rows,
        }

    def json(self) -> str:
        """Return `document` as text, without the time of day and the name of the machine."""
        return json.dumps(self.document(), indent=1, ensure_ascii=False, allow_nan=False) + "\n"

    def page(self) -> str:
        """Return the page: the summary, all verdicts, and replays of the worst."""
        order = self.by_severity()
        return render_page(
            "drives.html.j2",
            ("scene.js", "drives.js", "tables.js"),
            drawings(self.outcomes, self.trials, order[:MAX_REPLAYS_COUNT]),
            planner=self.planner,
            rates=rates(self.outcomes),
            rows=[
                (number if number < MAX_REPLAYS_COUNT else None, self.outcomes[k])
                for number, k in enumerate(order)
            ],
            broken=self.broken,
            notes=self.notes(),
            comparison=self.comparison,
            parameters=values_of(self.config),
        )

    def facts(self) -> dict[str, str]:
        """Return the properties for JUnit."""
        blind = {} if self.blind is None else {"best blind planner": str(self.blind)}
        return self.config.facts() | blind

    def write(self, folder: Path) -> None:
        """Write JSON, JUnit's XML and, if there are trials, the page to an existing folder.

        Raises:
            OSError: the disk is full, or the folder is not writable.
        """
        write_text(folder / JSON, self.json())
        write_text(folder / JUNIT, as_junit(self))
        if self.trials:
            write_text(folder / PAGE, self.page())


def as_junit(*suites: Drives) -> str:
    """Return one test case per scenario, as JUnit's XML, and facts as properties.

    Cases fail with the type collision, off_road, jump, goal, or the name of a criterion. A drive
    that an error of the planner ended has an error with its traceback.
    """
    as_json = partial(json.dumps, ensure_ascii=False)
    return render_xml("junit.xml.j2", suites=suites, as_json=as_json)


def drawings(
    outcomes: Sequence[Outcome],
    trials: Sequence[Trial],
    drawn: Sequence[int],
    max_frames: int = MAX_FRAMES_COUNT,
) -> dict[str, Any]:
    """Return the page's replays: the drives with some indices, and their roads."""
    roads = {id(trials[k].road): trials[k].road for k in drawn}
    place = {key: number for number, key in enumerate(roads)}
    return {
        "roads": [road_data(road) if road is not None else None for road in roads.values()],
        "drives": [
            _drawing(outcomes[k], trials[k], place[id(trials[k].road)], max_frames) for k in drawn
        ],
    }


def _drawing(outcome: Outcome, trial: Trial, road: int, max_frames: int) -> dict[str, Any]:
    drive, verdict = outcome.drive, outcome.verdict
    motion = drive.motion
    frames = max(2, min(max_frames, int(np.ceil(verdict.duration / FRAME_PERIOD_S)) + 1))
    spans = [
        motion.time[row][[0, -1]].tolist() if row.any() else [0.0, -1.0] for row in drive.present
    ]
    witness = trial.scenario
    stride = -(-len(witness.time) // min(max_frames, 100))
    return {
        "name": outcome.name,
        "sentence": verdict.sentence(),
        "road": road,
        "ego": drive.ego,
        "vehicles": [
            {"id": v.id, "type": v.type, "length": round(v.length, 3), "width": round(v.width, 3)}
            for v in motion.vehicles
        ],
        "motion": {
            "states": pack(states(motion, frames)[None]),
            "durations": [round(verdict.duration, 3)],
        }
        | lights_of_all([motion]),
        "witness": [
            [round(x, 2), round(y, 2)] for x, y in witness.position[drive.ego, ::stride].tolist()
        ],
        "spans": [[round(time, 3) for time in span] for span in spans],
        "hit": round(verdict.collision.time, 3) if verdict.collision else None,
    }
