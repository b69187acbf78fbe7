# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Coverage by recordings and the sets generated from them, with table and remarks."""

from dataclasses import dataclass
import math

from scenario_gen.types import Interval

COVERAGE_GOAL_SHARE = 0.9


@dataclass(frozen=True)
class CoveragePoint:
    """Coverage by a number of templates, alone and with generated sets, and precision.

    Shares are medians over draws of templates, with the 5 and 95 % quantiles.

    Attributes:
        templates: drawn.
        alone: coverage by the templates.
        generated: coverage by templates and generated.
        precision: of the generated; `recorded`: of the templates themselves.
        multiplier: recordings that cover alone as much (with the quantiles of `generated`), over
            `templates`; inf: more than there are.
    """

    templates: int
    alone: Interval
    generated: Interval
    precision: Interval
    recorded: Interval
    multiplier: Interval


@dataclass(frozen=True)
class Unreached:
    """A recorded encounter, or a scenario, that is near nothing recorded elsewhere.

    Attributes:
        encounter: its name; of a scenario that of its template.
        kind: of KINDS.
        distance: to the nearest, in units of r.
        feature: in which they differ most.
        scenario: number of the scenario, -1 of an encounter.
    """

    encounter: str
    kind: str
    distance: float
    feature: str
    scenario: int = -1


@dataclass(frozen=True)
class Population:
    """What recordings and the sets generated from them cover.

    Attributes:
        encounters: recorded, by kind.
        scenarios: generated from them, by kind.
        curve: coverage by number of templates, drawn of all kinds.
        by_kind: the same by kind, of templates that are all of that kind; without kinds that hold
            too few.
        unreached: encounters that no other recording's set reaches, the farthest first.
        farthest: scenarios that are farthest from all recorded encounters, at most ten.
        needed: recordings that would cover 0.9 by the curve's extrapolation, inf where it does not
            rise.
    """

    encounters: dict[str, int]
    scenarios: dict[str, int]
    curve: tuple[CoveragePoint, ...]
    by_kind: dict[str, tuple[CoveragePoint, ...]]
    unreached: tuple[Unreached, ...]
    farthest: tuple[Unreached, ...]
    needed: float

    @property
    def lead(self) -> str:
        """What was measured, in a sentence."""
        kinds = ", ".join(f"{count} {kind}" for kind, count in sorted(self.encounters.items()))
        recorded, made = (sum(counts.values()) for counts in (self.encounters, self.scenarios))
        return f"{recorded} encounters whose vehicles share an area ({kinds}), {made} scenarios"

    def table(self) -> tuple[tuple[str, ...], list[tuple[str, ...]]]:
        """Return columns and rows of the curves as texts; quantiles are in brackets."""
        columns = (
            "of",
            "templates",
            "coverage alone",
            "with generated",
            "precision",
            "of the recorded",
            "stand for",
        )
        rows = []
        for kind, curve in {"all kinds": self.curve, **self.by_kind}.items():
            for point in curve:
                shares = (point.alone, point.generated, point.precision, point.recorded)
                rows.append(
                    (kind, str(point.templates), *map(in_words, shares), _stands_for(point))
                )
        return columns, rows

    def remarks(self) -> list[str]:
        """Return what the curve says, in sentences."""
        needed = (
            f"{self.needed:.0f} recorded encounters"
            if math.isfinite(self.needed)
            else "more encounters than can be told"
        )
        lines = [
            f"coverage of {COVERAGE_GOAL_SHARE} takes {needed}, if the curve goes on as it does"
        ]
        if self.unreached:
            worst = self.unreached[0]
            farthest = f"the farthest is {worst.encounter} ({worst.kind}): {worst.feature}"
            lines.append(f"{len(self.unreached)} encounters are never reached; {farthest}")
        return lines


def _stands_for(point: CoveragePoint) -> str:
    """How many recordings, with the quantiles."""

    def words(multiplier: float) -> str:
        return (
            f"{multiplier * point.templates:.0f}"
            if math.isfinite(multiplier)
            else "more than there are"
        )

    estimate = point.multiplier
    return f"{words(estimate.value)} [{words(estimate.low)}, {words(estimate.high)}]"


def in_words(share: Interval) -> str:
    """Return a share with its quantiles in brackets."""
    return f"{share.value:.2f} [{share.low:.2f}, {share.high:.2f}]"
