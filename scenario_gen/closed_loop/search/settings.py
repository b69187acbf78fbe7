# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The constants of a search for failures."""

from dataclasses import dataclass


@dataclass(frozen=True)
class SearchSettings:
    """Constants of a search; they change its cost, but not the validity of its intervals.

    Attributes:
        confidence: of all intervals.
        explored_share: share of the drives that explore.
        min_population: drives of one level of an exploration.
        max_population: bound of its growth.
        drives_per_member: a level grows by one drive for this number of drives so far.
        members_per_seed: the best of this number of drives start the chains of the next level.
        moves: candidates of one step of a chain, of which one is driven.
        max_levels: of one exploration.
        first_explored: drives of the first exploration, after which it is cut; later ones are cut
            when they have used `explored_share` of all drives.
        first_step: standard deviation of the noise of the first moves, in that of a candidate.
        accepted_share: of the moves, to which the step is adapted.
        traced_share: of the moves that must stay as near to failure as the level before; fewer say
            that nothing foretells failure, unless moves fail.
        traced_failures: number of moves of an exploration that fail, which is a trace, too.
        untraced_share: share of the drives that explore then; all others are natural.
        batch: natural candidates that are drawn at once.
        refit_ratio: growth of the number of drives that asks for a new regression.
        even_share: share of the drives of a batch that are chosen evenly, until a drive fails.
        min_even_probability: lower bound of the probability that each scenario of a batch is
            driven.
        max_even_probability: its upper bound while failures are rare and expected.
        prior_surprises: unexpected failures that are assumed before the first drive.
        prior_precision: share of failures among the drives near to failure, assumed likewise.
        frequent_ratio: if failures are more frequent than `max_even_probability`, this multiple of
            their rate is driven: they need no choice.
        extra_even_ratio: weight of the hit that the upper end of an interval allows for, over that
            of an evenly chosen drive.
        extra_rate_ratio: bound of that weight over the rate: rare failures that are all foreseen
            keep narrow intervals.
        few_hits_ratio: over the square of the number of hits it is added to that bound. With 0,
            92 % of the intervals of 300 drives hold the rate of a planner that fails in two
            opposite regions; with 3, 96 %.
        error_factor: on the error of the regression; a larger one means more drives and smaller
            weights.
    """

    confidence: float = 0.95
    explored_share: float = 0.2
    min_population: int = 24
    max_population: int = 96
    drives_per_member: int = 25
    members_per_seed: int = 4
    moves: int = 24
    max_levels: int = 12
    first_explored: int = 110
    first_step: float = 0.5
    accepted_share: float = 0.4
    traced_share: float = 0.25
    traced_failures: int = 2
    untraced_share: float = 0.05
    batch: int = 256
    refit_ratio: float = 1.1
    even_share: float = 0.95
    min_even_probability: float = 0.005
    max_even_probability: float = 0.1
    prior_surprises: float = 0.02
    prior_precision: float = 0.5
    frequent_ratio: float = 1.5
    extra_even_ratio: float = 0.4
    extra_rate_ratio: float = 0.7
    few_hits_ratio: float = 3.0
    error_factor: float = 3.0


SETTINGS = SearchSettings()
