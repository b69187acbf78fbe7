# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""What distinguishes the drivers: fitted to the certified motion of each, or else drawn."""

from collections.abc import Mapping
from typing import NamedTuple
from zlib import crc32

import numpy as np

from scenario_gen.closed_loop.config import ClosedLoopConfig
from scenario_gen.numerics import Bools, Floats
from scenario_gen.situation import Conflict, lane_gaps
from scenario_gen.situation.gaps import MIN_HEADWAY_SPEED_MPS
from scenario_gen.types import Scenario

MAX_HEADWAY_S = 4.0  # a vehicle farther behind another one does not follow it
HEADWAY_SPREAD_RATIO = 0.3  # standard deviation of the logarithm of the time gap among drivers
PATIENCE_SPREAD_RATIO = 0.38  # of that of the patience
LAG_LOGISTIC_PER_S = 0.8  # P(goes first at a lag of x) = logistic(0.8 x) at recorded conflicts
LEAST_TRAIT_RATIO = 0.7  # of the parameter, that a calm recording shows of a driver
SAME_WAY_RATIO = 0.7  # least cosine of the angle between the headings of one stream
MIN_MARGIN_S = 1.0  # post-encroachment time that a driver who goes first leaves at least


class DriverTraits(NamedTuple):
    """Traits of N drivers, all (N,).

    Attributes:
        headway: desired time gaps [s].
        acceleration: largest accelerations [m/s²].
        braking: comfortable braking [m/s²].
        patience: waiting times before a driver goes ahead of a vehicle that stands [s].
        margin: least time between a driver that goes ahead of the ego, and the ego [s].
    """

    headway: Floats
    acceleration: Floats
    braking: Floats
    patience: Floats
    margin: Floats


def driver_draws(scenario: Scenario, vehicle: str) -> np.random.Generator:
    """Return the source of a driver's draws.

    It depends only on the scenario's seed and index and on the vehicle's id, not on the ego.
    """
    numbers = (scenario.seed, scenario.seed >> 32, scenario.index, crc32(vehicle.encode()))
    return np.random.default_rng([number % 2**32 for number in numbers])


def reaction_time(scenario: Scenario, vehicle: str, mean: float) -> float:
    """Draw a driver's reaction time [s], uniformly from 0.5 to 1.5 times the mean."""
    return mean * (0.5 + float(driver_draws(scenario, vehicle).random()))


def driver_traits(scenario: Scenario, config: ClosedLoopConfig) -> DriverTraits:
    """Return the traits of the drivers of a scenario."""
    recorded = _recorded_headways(scenario, config.standstill_gap)
    rows = []
    for n, vehicle in enumerate(scenario.vehicles):
        draws = driver_draws(scenario, vehicle.id)
        draws.random()  # that of the reaction time
        headway = config.headway * np.exp(HEADWAY_SPREAD_RATIO * draws.standard_normal())
        patience = config.patience * np.exp(PATIENCE_SPREAD_RATIO * draws.standard_normal())
        margin = max(MIN_MARGIN_S, draws.logistic() / LAG_LOGISTIC_PER_S)
        usual = np.quantile(scenario.acceleration[n], (0.95, 0.05)) * (1.0, -1.0)
        most = np.array((config.acceleration, config.comfortable_braking))
        acceleration, braking = np.clip(usual, LEAST_TRAIT_RATIO * most, most)
        rows.append((recorded.get(n, headway), acceleration, braking, patience, margin))
    return DriverTraits(*np.array(rows).T)


def insisting(scenario: Scenario, ego: int, conflicts: Mapping[int, Conflict]) -> Bools:
    """Return (N,) which vehicles insist on their turn: those of a stream that the ego crosses.

    The ego waits for one of them, and another one comes behind it in the same direction: who gives
    way to the one gives way to the other.

    Args:
        scenario: certified.
        ego: index of the witness of the ego.
        conflicts: those of the witness, by the index of the other vehicle.
    """
    insists = np.zeros(len(scenario.vehicles), dtype=np.bool_)
    yaws: dict[bool, dict[int, float]] = {True: {}, False: {}}  # by whether it goes first
    begin = scenario.time[scenario.present[ego, 0]]
    for other, conflict in conflicts.items():
        goes_first = conflict.first == other
        entries = conflict.entry_first, conflict.entry_second
        entry, ego_entry = entries if goes_first else entries[::-1]
        if ego_entry > begin and not scenario.vehicles[other].kind.walks:
            yaw = np.interp(entry, scenario.time, scenario.heading[other])
            yaws[goes_first][other] = float(yaw)
    for first, yaw in yaws[True].items():
        for second, other_yaw in yaws[False].items():
            insists[[first, second]] |= np.cos(yaw - other_yaw) >= SAME_WAY_RATIO
    return insists


def _recorded_headways(scenario: Scenario, standstill: float) -> dict[int, float]:
    """Return the desired time gap [s] of each vehicle that follows another one, by its index.

    At that time gap and its speed, the intelligent driver model keeps the median recorded gap.
    """
    headways: dict[int, float] = {}
    for (follower, _), (speed, gap) in lane_gaps(scenario).items():
        drives = (speed > MIN_HEADWAY_SPEED_MPS) & (gap < MAX_HEADWAY_S * speed)
        if drives.any():
            headway = float(np.median((gap - standstill)[drives] / speed[drives]))
            headways[follower] = min(headways.get(follower, np.inf), max(headway, 0.0))
    return headways
