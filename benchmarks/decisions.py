# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Is P(goes first), the law of drawn decisions, that of recorded drivers?

The pairs of `_coverage_pairs.json` (SCENARIO_GEN_DATA) in which something was to be decided: paths
meet, and nobody follows. Each has an offered lag, at which neither driver had decided; the outcome
is who went first. β is fitted by maximum likelihood, without the sessions that it is judged on,
and to all. The Brier score of a coin is 0.25.
"""

from collections.abc import Iterator
from itertools import pairwise

import numpy as np
from scipy import optimize, special

from benchmarks.coverage import recorded_pairs
from benchmarks.row import higher, lower, Row
from scenario_gen.base.errors import RefusedError
from scenario_gen.method.approaches import approaches, offered_lag_of, pair_of
from scenario_gen.method.decisions import refuse_undecided
from scenario_gen.method.sampling import SamplingConfig
from scenario_gen.numerics import Floats
from scenario_gen.situation import EncounterKind

NEAR_S = (0.0, 1.0, 2.5, np.inf)  # offered lags, for the reliability
MAX_RATE = 10.0  # 1/s


def run() -> list[Row]:
    """Measure."""
    pairs = list(_lags())
    sessions = np.array([session for session, _ in pairs])
    ahead = -np.array([lag for _, lag in pairs])  # of the driver who went first [s]
    rate = SamplingConfig().decision_rate
    names, counts = np.unique(sessions, return_counts=True)
    text = ", ".join(f"{name} {count}" for name, count in zip(names, counts, strict=True))
    rows = [higher("decided conflicts", len(ahead), "", None, text)]
    held_out = np.concatenate(
        [_errors(ahead[sessions == name], _rate(ahead[sessions != name])) for name in names]
    )
    rows.append(lower("Brier score, left-out sessions", held_out.mean(), "", 0.18))
    rows.append(lower("Brier score, shipped β", _errors(ahead, rate).mean(), "", 0.18))
    rows.append(higher("β fitted to all", _rate(ahead), "1/s", None, f"shipped {rate:g}"))
    for low, high in pairwise(NEAR_S):
        chosen = ahead[(np.abs(ahead) >= low) & (np.abs(ahead) < high)]
        if len(chosen):
            foretold = float(special.expit(rate * np.abs(chosen)).mean())
            name = f"the earlier one goes first, lag {low:g} to {high:g} s"
            text = f"foretold {foretold:.2f}, {len(chosen)} conflicts"
            rows.append(higher(name, (chosen > 0.0).mean(), "", None, text))
    return rows


def _lags() -> Iterator[tuple[str, float]]:
    """Yield session and offered lag [s] of each pair, as that of who went second."""
    for session, encounter in recorded_pairs():
        pair = pair_of(encounter)
        if pair is None or pair.kind is EncounterKind.FOLLOWING:
            continue
        try:
            refuse_undecided(pair)
            yield session, offered_lag_of(*approaches(pair))
        except RefusedError:
            continue


def _rate(ahead: Floats) -> float:
    """Return the likeliest β [1/s]."""
    found = optimize.minimize_scalar(
        lambda rate: -special.log_expit(rate * ahead).sum(), bounds=(0.0, MAX_RATE)
    )
    return float(found.x)


def _errors(ahead: Floats, rate: float) -> Floats:
    """Return the squared errors of P(goes first) of the drivers who went first."""
    return np.asarray(np.square(1.0 - special.expit(rate * ahead)))
