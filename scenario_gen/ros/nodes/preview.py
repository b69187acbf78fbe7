# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""preview: the last published scenario in motion, on /tf and `preview`.

It is for people who look: it keeps nobody waiting, and of many scenarios it takes the newest when
the one that is shown ends. Frames are `preview/vehicle_<id>`, so that a player of the same
vehicles is not disturbed.
"""

from dataclasses import dataclass
from time import monotonic

import numpy as np

from msg_conventions.fits import decode_fit
from msg_conventions.frames import encode_frames
from msg_conventions.markers import Action, Kind, Marker
from msg_conventions.pictures import body, COLOURS_RGB, encode_markers
from msg_conventions.scenario_info import ScenarioEntry
from scenario_gen.bags.recordings.scenario_decoder import ScenarioDecoder, TOPICS
from scenario_gen.base.parameters import parameter, Parameters
from scenario_gen.numerics import Floats
from scenario_gen.ros.common.stage_node import StageNode
from scenario_gen.ros.common.timers import create_steady_timer
from scenario_gen.ros.common.topics import create_frames_publisher
from scenario_gen.situation import find_conflicts
from scenario_gen.types import Scenario, tokens

IDLE_PERIOD_S = 1.0  # between two looks whether there is something to show, to somebody


@dataclass(frozen=True)
class Config(Parameters):
    """The preview's parameters."""

    frame_rate: float = parameter(20.0, "frames a second", unit="Hz", low=1.0, high=100.0)
    pause: float = parameter(
        1.0, "how long the end is shown before it begins again", unit="s", low=0.0, high=60.0
    )


@dataclass(frozen=True, eq=False)
class Shown:
    """A scenario in motion.

    Attributes:
        scenario: the scenario.
        since: its start on the steady clock [s].
        reactions: texts by the reacting vehicle.
        conflicts: the pose [m, m, rad] of the second vehicle at its entry, with a text.
    """

    scenario: Scenario
    since: float
    reactions: dict[str, str]
    conflicts: tuple[tuple[tuple[float, float, float], str], ...]


class Preview(StageNode):
    """Shows the newest scenario."""

    INPUTS = ("fit", *TOPICS)
    OUTPUTS = ("preview",)
    STAGES = ("situation",)

    def __init__(self, namespace: str | None = None) -> None:
        super().__init__("preview", Config(), namespace)
        self._tf = create_frames_publisher(self)
        self._arriving = ScenarioDecoder()
        self._newest: tuple[Scenario, ScenarioEntry] | None = None
        self._shown: Shown | None = None
        self._anchors = np.zeros((0, 0, 3))
        self._timer = create_steady_timer(self, IDLE_PERIOD_S, self._tick)

    def stopped(self) -> None:
        """Forget what was shown."""
        self._arriving = ScenarioDecoder()
        self._newest = self._shown = None

    def received(self, topic: str, data: bytes) -> None:
        """Take changepoints, and each scenario once all of its messages have come."""
        if topic == "fit":
            self._anchors = decode_fit(data)[3]
            return
        if decoded := self._arriving.add(topic, data):
            entry, _, scenario = decoded
            self._newest = scenario, entry

    def _pace_ticks(self) -> None:
        """Tick at the frame rate while a scenario is watched."""
        period = IDLE_PERIOD_S
        if self._newest and (self.count_subscribers("preview") or self.count_subscribers("/tf")):
            period = 1.0 / self.config.frame_rate
        period_ns = round(period * 1e9)
        if period_ns != self._timer.timer_period_ns:
            self._timer.timer_period_ns = period_ns
            self._timer.reset()

    def _tick(self) -> None:
        """Publish where everybody is."""
        self._pace_ticks()
        now, shown = monotonic(), self._shown
        if shown is None or now - shown.since > float(shown.scenario.time[-1]) + self.config.pause:
            if self._newest is None:
                return
            scenario, entry = self._newest
            texts = {reaction.who: str(reaction) for reaction in entry.facts.reactions}
            reactions = dict(sorted(texts.items()))
            self._shown = shown = Shown(
                scenario.with_trailers(), now, reactions, conflicts_of(scenario)
            )
        self._publish(shown, min(now - shown.since, float(shown.scenario.time[-1])))

    def _publish(self, shown: Shown, time: float) -> None:
        scenario = shown.scenario
        stamp_ns = self.get_clock().now().nanoseconds
        present, poses, speeds = states_at(scenario, time)
        names = tokens(scenario.ids)
        children = [f"preview/vehicle_{names[n]}" for n in present]
        self.outputs.publish(self._tf, encode_frames(poses, children, scenario.frame_id, stamp_ns))

        markers = [Marker("", Kind.CUBE, Action.DELETE_ALL)]
        for n, (x, y, yaw), speed in zip(present, poses.tolist(), speeds.tolist(), strict=True):
            vehicle = scenario.vehicles[n]
            markers.append(
                body(names[n], vehicle, (x, y, yaw), COLOURS_RGB[n % len(COLOURS_RGB)], 0.9)
            )
            text = f"{shown.reactions.get(names[n], names[n])}, {speed:.1f} m/s"
            markers.append(text_marker(f"text_{names[n]}", (x, y + vehicle.length, 0.0), text))
        for k, (pose, text) in enumerate(shown.conflicts):
            markers.append(
                Marker(
                    f"conflict_{k}",
                    Kind.CUBE,
                    pose=pose,
                    scale=(2.0, 2.0, 0.1),
                    colour=(0.9, 0.1, 0.1, 0.5),
                )
            )
            markers.append(text_marker(f"conflict_text_{k}", pose, text))
        markers += changepoint_markers(self._anchors[:, 1:-1])
        self.outputs.send("preview", encode_markers(markers, scenario.frame_id, stamp_ns))


def text_marker(name: str, pose: tuple[float, float, float], text: str) -> Marker:
    """Return a text at a pose [m, m, rad]."""
    return Marker(name, Kind.TEXT, pose=pose, scale=(0.0, 0.0, 1.2), text=text)


def changepoint_markers(anchors: Floats) -> list[Marker]:
    """Return a box for each changepoint; `anchors` (N, K, 3) x, y [m], yaw [rad]."""
    markers = []
    for n, poses in enumerate(anchors):
        colour = (*COLOURS_RGB[n % len(COLOURS_RGB)], 0.6)
        for k, (x, y, yaw) in enumerate(poses.tolist()):
            markers.append(
                Marker(
                    f"changepoint_{n}_{k}",
                    Kind.CUBE,
                    pose=(x, y, yaw),
                    scale=(0.6, 0.6, 0.2),
                    colour=colour,
                )
            )
    return markers


def conflicts_of(scenario: Scenario) -> tuple[tuple[tuple[float, float, float], str], ...]:
    """Return the pose of the second vehicle at each conflict, with a text."""
    names = tokens(scenario.ids)
    conflicts = []
    for conflict in find_conflicts(scenario):
        x, y, yaw = scenario.at(conflict.entry_second).poses[conflict.second].tolist()
        first, second = names[conflict.first], names[conflict.second]
        text = f"{first} first, {second} {conflict.encroachment:.1f} s later"
        if conflict.following:
            text = f"{second} behind {first}"
        conflicts.append(((x, y, yaw), text))
    return tuple(conflicts)


def states_at(scenario: Scenario, time: float) -> tuple[list[int], Floats, Floats]:
    """Return the present vehicles at a time [s], their poses (M, 3) and speeds (M,) [m/s]."""
    states = scenario.at(time)
    present = np.flatnonzero(states.is_present)
    return present.tolist(), states.poses[present], states.speed[present]
