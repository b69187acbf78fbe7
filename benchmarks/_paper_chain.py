# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The paper's own chain, in cells: placed by given ends (eqs 7-9), RRT*-Connect with step 5, y as a function of x (eqs 11-15).

What the paper leaves open is settled here: y is a function of x in the frame of the vehicle's own chord, since a turn has
no y(x) along the grid's axes; and the speed profile has one interior knot per primitive (see docs/method.md).
"""

from dataclasses import dataclass
from itertools import product

import numpy as np

from benchmarks._disc_routes import plan_polylines
from benchmarks._paper_speed_knots import speed_knots
from benchmarks._paper_speed_profile import knots_on, SpeedProfile, SpeedProfileQP
from benchmarks._reference_sets import without_changepoints
from scenario_gen.base.errors import InputError, RefusedError
from scenario_gen.method.fitting import fit_template, FittingConfig
from scenario_gen.method.fitting.fit import assemble_fit
from scenario_gen.method.fitting.placement import place_given
from scenario_gen.method.routing import PlanningConfig
from scenario_gen.method.sampling.gp import Features, Observations, Posterior, Regression
from scenario_gen.numerics import Bools, Floats, wrap_angle
from scenario_gen.roads import build_road, RoadConfig
from scenario_gen.situation import find_waits, Situation, Wait
from scenario_gen.types import Dynamics, Encounter, Fit, Road, Route, Segmentation

SIGMA, LENGTH, NOISE, DEGREE = 10.0, 100.0, 10.0, 3
"""The paper's σ_f and l of eq 14 and σ_ω, the standard deviation at an interior anchor, in cells; degree of the mean."""
ROADS = ("straight", "t_intersection")
"""The paper's roads (IV-B), in the order in which they are tried: a road along which, else a junction."""
SIDE, HALF_ROAD, VERGE = 1000.0, 100.0, 20.0
PAPER = RoadConfig(
    lanes=1,
    lane_width=HALF_ROAD,
    corner_radius=HALF_ROAD / 2.0,
    resolution=1.0,
    arm_length=SIDE / 2.0,
)
"""Of the paper's roads (IV-B): 1000 cells from end to end, lengths in cells."""
"""Cells: side of the grid, half the width of a road, room kept to the grid's edge."""
TRAINING_PERIOD = 1.0
"""Seconds between the training points on the planned path."""
ITERATIONS = 3000
END_SPEEDS, KNOTS = (1.0, 0.75, 0.5, 0.25, 0.0), (0.5, None, 0.3, 0.7, 0.1, 0.9)
"""Shares of the asked end speeds, and places of a primitive's knot, that are tried in this order until a speed profile exists."""
FITTING = FittingConfig(
    allow="lost_conflict", scale_low=0.01, scale_high=1000.0, max_move=100.0, clearance=0.0
)
PLANNING = PlanningConfig(iterations=ITERATIONS)
UNLIMITED = Dynamics(
    max_speed=1e6, max_acceleration=1e6, max_deceleration=1e6, max_lateral_acceleration=1e6
)


@dataclass(frozen=True, eq=False)
class Sampled:
    """S samples of N vehicles at the template's T instants.

    Attributes:
        fit: the template on the paper's road, in cells.
        routes: planned, in cells.
        position: (S, N, T, 2) cells.
        speed: (S, N, T) cells/s, by Euler differentiation (eq 16).
        notes: where the asked end speeds could not be kept.
    """

    fit: Fit
    routes: tuple[Route, ...]
    position: Floats
    speed: Floats
    notes: tuple[str, ...] = ()


def place(encounter: Encounter, segmentation: Segmentation) -> tuple[Road, Floats, Floats]:
    """Choose the road, and start and goal of every vehicle on it: (N, 3) x, y, yaw in cells.

    The metric fitting says which lanes the template takes and how far from the junction it begins and ends; the paper's
    road has the same lanes, 100 cells wide. So the metric road is the plain one, not shaped to the template: its arms are
    those of the paper's, in the same order and straight.

    Raises:
        RefusedError: it fits none of the paper's roads; the message has the reason for each.
    """
    reasons = []
    reach = max(60.0, float(np.ptp(encounter.position, axis=(0, 1)).max()))
    for name, lanes in product(ROADS, (1, 2, 3)):
        try:
            metric = build_road(name, None, RoadConfig(lanes=lanes, arm_length=reach))
            fit = fit_template(
                encounter, segmentation, metric, FittingConfig(allow="lost_conflict")
            )
        except RefusedError as error:
            reasons.append(f"{name}: {error}")
            continue
        road = build_road(name, None, PAPER)
        try:
            return road, *_evenly_scaled(
                encounter, segmentation, road, _Lanes.of(road, metric, fit)
            )
        except RefusedError as error:
            reasons.append(f"{name}: {error}")
    raise RefusedError("it fits none of the paper's roads; " + "; ".join(reasons))


@dataclass(frozen=True, eq=False)
class _Lanes:
    """Where starts and ends are on a road's lanes.

    Attributes:
        found: for starts and for ends, per vehicle: whether the lane leaves, its arm, and metres outwards from the centre.
        junction: metres from the centre to the junction's edge, 0 on a road without one.
        still: vehicles that stand throughout.
    """

    found: tuple[list[tuple[bool, int, float]], list[tuple[bool, int, float]]]
    junction: float
    still: Bools

    @classmethod
    def of(cls, road: Road, metric: Road, fit: Fit) -> "_Lanes":
        """Read them off a fit to the metric road that has the arms of `road`."""
        lanes = len(metric.entries) // len(road.entries)
        centre = metric.entries[: 2 * lanes, :2].mean(axis=0)
        found = []
        for side in (fit.requested.start, fit.requested.end):
            poses = [_on_lane(metric, pose, centre) for pose in side[:, :3]]
            found.append([(leaves, lane // lanes, distance) for leaves, lane, distance in poses])
        junction = 0.0 if road.name == "straight" else 3.5 * lanes
        return cls(
            (found[0], found[1]),
            junction,
            np.array([fitted.stands.all() for fitted in fit.fitted]),
        )

    def most_cells(self) -> float:
        """Cells per metre outside the junction with which the farthest start or end is just on the grid."""
        farthest = max(abs(distance) for side in self.found for _, _, distance in side)
        room = SIDE / 2.0 - VERGE - (HALF_ROAD if self.junction else 0.0)
        return room / max(farthest - self.junction, 1.0)

    def ends(self, road: Road, cells: Floats) -> tuple[Floats, Floats]:
        """Starts and goals (N, 3) on the paper's road with so many cells (N,) per metre outside the junction."""
        states = [
            np.array(
                [self._pose(road, *lane, float(c)) for lane, c in zip(side, cells, strict=True)]
            )
            for side in self.found
        ]
        states[1][self.still] = states[0][self.still]
        return states[0], states[1]

    def _pose(
        self, road: Road, leaves: bool, arm: int, distance: float, cells: float
    ) -> list[float]:
        x, y, heading = (road.exits if leaves else road.entries)[arm]
        outside = abs(distance) - self.junction
        reach = cells * outside + (HALF_ROAD if self.junction else 0.0)
        if outside < 0.0:
            reach = abs(distance) * HALF_ROAD / self.junction
        back = (SIDE / 2.0 - np.sign(distance) * reach) * (-1.0 if leaves else 1.0)
        return [x + back * np.cos(heading), y + back * np.sin(heading), heading]


def _evenly_scaled(
    encounter: Encounter, segmentation: Segmentation, road: Road, lanes: _Lanes
) -> tuple[Floats, Floats]:
    """Starts and goals with which eq 9 has, as nearly as the junction allows, one scale s for all vehicles.

    s is linear in the cells per metre outside the junction, so that two fits tell where it is the least vehicle's.
    """

    def scales(cells: Floats) -> Floats:
        starts, goals = lanes.ends(road, cells)
        fit = _fit_to_ends(encounter, without_changepoints(segmentation), road, (starts, goals))
        return np.array([fitted.scale for fitted in fit.fitted])

    most = np.full(len(encounter.vehicles), lanes.most_cells())
    wide, narrow = scales(most), scales(0.5 * most)
    target = wide[~lanes.still].min(initial=np.inf)
    slope = 2.0 * (wide - narrow) / most
    with np.errstate(divide="ignore", invalid="ignore"):
        cells = np.where(slope > 0.0, most - (wide - target) / slope, most)
    return lanes.ends(road, np.clip(np.where(lanes.still, most, cells), 0.05 * most, most))


def _fit_to_ends(
    encounter: Encounter, segmentation: Segmentation, road: Road, ends: tuple[Floats, Floats]
) -> Fit:
    """The fit with start and end poses (N, 3) of all vehicles."""
    situation = Situation.of(encounter)
    starts, goals = (np.pad(poses, ((0, 0), (0, 1)), constant_values=np.nan) for poses in ends)
    placement, given = place_given(situation, road, FITTING, starts, goals)
    return assemble_fit(situation, segmentation, road, placement, FITTING, given)


def _on_lane(road: Road, pose: Floats, centre: Floats) -> tuple[bool, int, float]:
    """Which lane a pose is on: whether it leaves, its number, and the distance from the centre outwards along it."""
    best, answer = np.inf, (False, 0, 0.0)
    for leaves, gates in ((False, road.entries), (True, road.exits)):
        for lane, gate in enumerate(gates):
            along = np.array([np.cos(gate[2]), np.sin(gate[2])])
            outward = along if leaves else -along
            offset = pose[:2] - gate[:2]
            distance = float((pose[:2] - centre) @ outward)
            off = abs(offset @ np.array([-along[1], along[0]])) + 10.0 * abs(
                float(wrap_angle(np.asarray(pose[2] - gate[2])))
            )
            cost = float(off) + (0.0 if distance >= 0.0 else 1.0)
            if cost < best:
                best, answer = cost, (leaves, lane, distance)
    return answer


def sample(
    encounter: Encounter,
    segmentation: Segmentation,
    road: Road,
    ends: tuple[Floats, Floats],
    *,
    count: int,
    seed: int,
) -> Sampled:
    """Fit, plan and sample with these changepoints; `ends` are start and end poses (N, 3) [m, m, rad] of all vehicles.

    Raises:
        RefusedError: it cannot be placed, planned or timed.
    """
    try:
        fit = _fit_to_ends(encounter, segmentation, road, ends)
        routes = plan_polylines(road, fit, PLANNING, seed)
        waits = find_waits(encounter) if segmentation.changepoints.size else ()
        drawn = [
            _vehicle(encounter, fit, n, route, waits=waits, count=count, seed=seed)
            for n, route in enumerate(routes)
        ]
    except InputError as error:  # no y(x), e.g. a vehicle that returns to where it started
        raise RefusedError(str(error)) from error
    position = np.stack([found for found, _ in drawn], axis=1)
    notes = tuple(
        f"vehicle {vehicle.id}: no piecewise constant acceleration meets length, duration and end speeds; "
        f"the end speeds were lowered to {factor:.0%}"
        for vehicle, (_, factor) in zip(encounter.vehicles, drawn, strict=True)
        if factor < 1.0
    )
    step = np.diff(position, axis=2)
    speed = np.hypot(step[..., 0], step[..., 1]) / encounter.dt  # eq 16
    return Sampled(fit, routes, position, np.concatenate([speed, speed[..., -1:]], axis=-1), notes)


def _vehicle(
    encounter: Encounter,
    fit: Fit,
    n: int,
    route: Route,
    *,
    waits: tuple[Wait, ...],
    count: int,
    seed: int,
) -> tuple[Floats, float]:
    """(S, T, 2) positions of one vehicle, and the share of its end speeds that could be kept."""
    if len(route.points) == 1:
        return np.broadcast_to(route.points[0, :2], (count, len(encounter.time), 2)).copy(), 1.0
    times = encounter.time[fit.anchor_index]
    profile, factor = _profile(encounter, fit, n, route, waits)
    clock = np.unique(np.concatenate([np.arange(0.0, times[-1], TRAINING_PERIOD), times]))
    training, wanted = (_along(route, profile.state(t)[0]) for t in (clock, encounter.time))
    turn = rotation(training[-1] - training[0])
    x = (wanted @ turn)[:, 0]
    there, back = np.unique(x, return_inverse=True)
    y = ordinate_samples(training @ turn, there, count, seed + 7919 * n)[:, back]
    return np.stack([np.broadcast_to(x, y.shape), y], axis=-1) @ turn.T, factor


def _profile(
    encounter: Encounter, fit: Fit, n: int, route: Route, waits: tuple[Wait, ...]
) -> tuple[SpeedProfile, float]:
    """The speed profile along the planned path: piecewise constant acceleration (IV-B); the share of the end speeds it keeps."""
    times = encounter.time[fit.anchor_index]
    own = [(wait.start, wait.end) for wait in waits if wait.vehicle == n]
    dwells = route.anchor[:-1] == route.anchor[1:]
    speeds = encounter.speed[n] * route.length[-1] / max(_driven(encounter, n), 1e-6)
    for factor, share in product(END_SPEEDS, KNOTS):
        asked = (factor * float(speeds[0]), factor * float(speeds[-1]))
        knots = speed_knots(times, dwells, own, encounter.time, speeds, asked, share)
        qp = SpeedProfileQP(knots, UNLIMITED)
        knot = knots_on(times[None], times, knots)
        reached = route.length[route.anchor]
        lengths = (reached[knots.bounds[:, 1]] - reached[knots.bounds[:, 0]])[None]
        speed, ok = qp.solve(knot, lengths)
        if not ok[0]:
            speed, ok, _ = qp.slide(knot, lengths)
        if ok[0]:
            return SpeedProfile(knot[0], speed[0]), factor
    raise RefusedError(
        f"vehicle {encounter.vehicles[n].id}: no piecewise constant acceleration drives its route in {times[-1]:.1f} s"
    )


def _driven(encounter: Encounter, n: int) -> float:
    """Metres that vehicle n drives in the template."""
    speed = encounter.speed[n]
    return float(0.5 * (speed[:-1] + speed[1:]).sum() * encounter.dt)


def _along(route: Route, station: Floats) -> Floats:
    """(m, 2) positions at arc lengths along the planned path."""
    return np.column_stack(
        [np.interp(station, route.length, route.points[:, axis]) for axis in (0, 1)]
    )


def rotation(direction: Floats) -> Floats:
    """Return the matrix (2, 2) whose product from the right turns `direction` (2,), of any unit, to the x axis."""
    turn = np.arctan2(direction[1], direction[0])
    return np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])


def ordinate_posterior(anchors: Floats, x: Floats) -> Posterior:
    """The posterior of y at x (m,) given one vehicle's anchors (A, 2) [m], with a cubic mean: the paper's sampler (III-C).

    It is exact at the first and the last anchor; the degree of the mean is lowered where there are too few anchors for it. For
    figures only: a function y(x) describes neither a vertical nor a time. What is published comes from `sample_scenarios`.

    Raises:
        InputError: fewer than two anchors, or all of them at the same x.
    """
    _, first = np.unique(anchors[:, 0], return_index=True)
    ends = [0, len(anchors) - 1]
    inner = [k for k in first.tolist() if anchors[k, 0] not in anchors[ends, 0]]
    keep = np.unique(np.concatenate([ends, inner])).astype(np.int64)
    seen_x, seen_y = anchors[keep].T
    low, high = min(seen_x.min(), x.min()), max(seen_x.max(), x.max())
    if len(keep) < 2 or seen_x[0] == seen_x[-1]:
        raise InputError(
            "y as a function of x needs anchors at two different x; use the parametric form"
        )
    noise = np.full(len(keep), NOISE)
    noise[[0, -1]] = 0.0
    features = Features(low, high, SIGMA, LENGTH, min(DEGREE, len(keep) - 1))
    return Regression(features, Observations(seen_x, seen_y, noise)).predict(x)


def ordinate_samples(anchors: Floats, x: Floats, count: int, seed: int = 0) -> Floats:
    """Curves (count, m) of y at x (m,) through one vehicle's anchors (A, 2), all in metres."""
    posterior = ordinate_posterior(anchors, x)
    generator = np.random.Generator(np.random.PCG64(np.random.SeedSequence([seed])))
    return posterior.sample(generator.standard_normal((count, posterior.factor.shape[1])))
