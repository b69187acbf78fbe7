# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""What a client of traffic commands its ego: the messages of its topics, understood, and how long they count."""

from collections.abc import Callable
from dataclasses import dataclass

from msg_conventions import driving
from msg_conventions.odometry import decode_odometry
from scenario_gen.base.errors import InputError
from scenario_gen.closed_loop.ego import Command, Pose
from scenario_gen.closed_loop.simulation import ClosedLoop, State
from scenario_gen.closed_loop.tracking import of_twist, Track

INPUTS = ("ego/cmd_vel", "ego/cmd_vel_stamped", "ego/trajectory", "ego/path", "ego/odom")
WAYS = ("ego/trajectory", "ego/path")  # their times say for when they are; they may be old
FIRST_STAMP = 1_000_000_000  # ns of a drive's clock at its start: a time of 0 means that none is known


@dataclass(frozen=True, eq=False)
class Heard:
    """A command: which step of the drive was the last when it came, its stamp [ns, 0: none], and what it gives at an instant."""

    topic: str
    step: int
    stamp_ns: int
    ask: Callable[[State], Command | Pose | None]
    fault: str = ""

    def fault_at(self, state: State, period: float, silence: float) -> str:
        """Return why it does not count now, "" if it does: its fault, or that it is older than `silence` [s].

        Args:
            state: the drive's last state.
            period: seconds of a step.
            silence: seconds after which a command is none.
        """
        if self.fault or self.topic in WAYS:
            return self.fault
        old = (state.step - self.step) * period
        if self.stamp_ns:
            old = max(old, stamp_of(state) * 1e-9 - self.stamp_ns * 1e-9)
        return f"{self.topic}: the last command is {old:.1f} s old" if old > silence else ""


def stamp_of(state: State) -> int:
    """Return a state's time on the drive's clock [ns]."""
    return FIRST_STAMP + round(state.time * 1e9)


def unusable(topic: str, step: int, fault: str) -> Heard:
    """Return what a message that cannot be used comes to: no command, and its fault."""
    return Heard(topic, step, 0, lambda _: None, fault)


def understood(topic: str, data: bytes, loop: ClosedLoop, child: str, step: int) -> Heard:
    """Return what a message asks.

    Args:
        topic: one of `INPUTS`.
        data: its CDR bytes.
        loop: the drive.
        child: the ego's own frame.
        step: the drive's last step.

    Raises:
        InputError: it is damaged, or in another frame.
    """
    period, frame, own = loop.config.step, loop.scenario.frame_id, (child, "base_link", "")
    if topic.startswith("ego/cmd_vel"):
        stamp, said, speed, rate = driving.decode_twist(data, topic, stamped=topic.endswith("stamped"))
        if said not in own and said != frame:
            raise InputError(f"{topic}: frame {said!r} is not the ego's; {', '.join(map(repr, own[:2]))} are")
        return Heard(topic, step, stamp, lambda state: of_twist(state.ego, speed, rate, period))
    if topic in WAYS:
        decode = driving.decode_trajectory if topic == "ego/trajectory" else driving.decode_timed_path
        way = decode(data, topic)
        stamp, said = 0, way.frame_id
        track = Track.of((way.time_ns - FIRST_STAMP) * 1e-9, way.poses)
        asked: Callable[[State], Command | Pose | None] = lambda state: track.command(state.ego, state.time, period)  # noqa: E731
    else:
        stamp, said, _, state = decode_odometry(data, topic)
        pose = Pose(*state[:4].tolist())
        asked = lambda _: pose  # noqa: E731
    if said != frame:
        raise InputError(f"{topic}: frame {said!r} is not that of the scenario, {frame!r}")
    return Heard(topic, step, stamp, asked)
