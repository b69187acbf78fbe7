# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The results of a planner test in one folder: JSON, JUnit's XML and a page.

The same drives give the same bytes.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
import json
import math
from pathlib import Path
from typing import Any

import numpy as np

from scenario_gen.base.folders import Kind, write_text
from scenario_gen.base.parameters import flatten
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
from scenario_gen.types import Decision

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

    def by_severity(self) -> list[int]:
        """Return the indices of the outcomes, the worst first."""
        order = range(len(self.outcomes))
        return sorted(
            order, key=lambda k: (*(-value for value in self.outcomes[k].verdict.severity), k)
        )

    def scores(self) -> dict[str, float]:
        """Return the means of nuPlan's and NAVSIM's scores and terms, and shares of criteria."""
        terms = []
        for outcome in self.outcomes:
            verdict = outcome.verdict
            met = {f"criterion {each.name}": float(not each.missed) for each in verdict.criteria}
            terms.append(verdict.document()["terms"] | met)
        return {
            name: math.fsum(values[name] for values in terms) / len(terms)
            for name in (terms[0] if terms else ())
        }

    def notes(self) -> list[str]:
        """Return sentences that qualify the figures."""
        messages = [
            self._origin_note(),
            self._outcomes_note(),
            self._copies_note(),
            self._baseline_note(),
            "" if self.blind is None else str(self.blind),
        ]
        if not self.config.observation.is_perfect:
            messages.append(f"observation of the others: {self.config.observation}")
        if self.comparison is not None:
            messages.append(self.comparison.sentence())
        if self.mutants is not None:
            messages.append(str(self.mutants))
        messages += [self._faults_note(), self._scores_note()]
        return [message for message in messages if message]

    def _encounters(self) -> list[str]:
        return sorted({outcome.origin.encounter for outcome in self.outcomes} - {""})

    def _origin_note(self) -> str:
        encounters = self._encounters()
        if len(encounters) == 1:
            return f"intervals cover this one encounter only ({encounters[0]})"
        if encounters:
            return (
                f"intervals cover encounters drawn like these {len(encounters)}: drives from one "
                "encounter are similar"
            )
        return ""

    def _outcomes_note(self) -> str:
        """Return how many drives pass with each outcome of the decisions, if they were drawn."""
        passed: dict[tuple[str, Decision], list[bool]] = {}
        for trial, outcome in zip(self.trials, self.outcomes, strict=False):
            decision = trial.scenario.facts.decision
            if decision is not None:
                key = trial.encounter, decision
                passed.setdefault(key, []).append(outcome.verdict.passed)
        if not passed:
            return ""
        by_outcome: dict[str, list[bool]] = {}
        for (_, decision), drives in passed.items():
            by_outcome.setdefault(decision.outcome, []).extend(drives)
        counts = [f"{name}: {sum(each)} of {len(each)}" for name, each in by_outcome.items()]
        shares = [sum(drives) / len(drives) for drives in passed.values()]
        share = np.average(shares, weights=[decision.probability for _, decision in passed])
        return (
            f"passed by outcome of the decision: {', '.join(counts)}; "
            f"{share:.0%} weighted by its probability"
        )

    def _copies_note(self) -> str:
        copies = len([outcome for outcome in self.outcomes if outcome.origin.copy_of])
        if not copies:
            return ""
        of_all = f"{copies} of {len(self.outcomes)} scenarios"
        return f"{of_all} are copies of another scenario from the same encounter"

    def _baseline_note(self) -> str:
        if not self.baseline:
            return ""
        groups: dict[str, list[bool]] = {name: [] for name in self._encounters()}
        for outcome in self.baseline:
            groups.setdefault(outcome.origin.encounter, []).append(outcome.verdict.passed)
        counts = [
            f"{sum(passed)} of {len(passed)} from {name}"
            for name, passed in groups.items()
            if name and passed
        ]
        by_encounter = f": {', '.join(counts)}" if 1 < len(counts) <= 12 else ""
        rate = passed_of(self.baseline)
        return f"the non-reactive baseline passes {rate}{by_encounter}"

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

    def _scores_note(self) -> str:
        scores = self.scores()
        if not scores:
            return ""
        nuplan, pdms = scores.pop("nuplan"), scores.pop("pdms")
        terms = [f"{name.replace('_', ' ')} {value:.3f}" for name, value in scores.items()]
        totals = f"nuPlan's score {nuplan:.3f}, NAVSIM's PDMS {pdms:.3f}"
        return f"{totals} (means; {', '.join(terms)})"

    def document(self) -> dict[str, Any]:
        """Return all verdicts and their summary as JSON's types."""
        known = [trial.scenario.facts.decision for trial in self.trials]
        decisions = known or [None] * len(self.outcomes)
        drives = [
            {
                "name": outcome.name,
                "encounter": outcome.origin.encounter,
                "scenario": outcome.origin.digest,
                "copy_of": outcome.origin.copy_of or None,
                "decision": decision.document() if decision else None,
                **outcome.verdict.document(),
            }
            for outcome, decision in zip(self.outcomes, decisions, strict=False)
        ]
        return {
            "planner": self.planner,
            **self.config.facts(),
            "parameters": {name: value for name, (_, value) in flatten(self.config).items()},
            "summary": {name: rate.document() for name, rate in rates(self.outcomes).items()},
            "scores": self.scores(),
            "baseline_pass": passed_of(self.baseline).document() if self.baseline else None,
            "best_blind": None if self.blind is None else self.blind.document(),
            "against": None if self.comparison is None else self.comparison.document(),
            "mutants": None if self.mutants is None else self.mutants.document(),
            "notes": self.notes(),
            "drives": drives,
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
            parameters={name: value for name, (_, value) in flatten(self.config).items()},
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
