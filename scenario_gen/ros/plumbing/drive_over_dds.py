# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""A planner that is a ROS 2 node of its own, driven through many scenarios over DDS in lock-step: `scenario-gen drive --ros`.

The node `traffic` runs in this process, and steps when the planner has answered: any node does that answers each odometry with
one command. The planner is started as a command, in a ROS domain in which nobody else is.
"""

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
import os
import shlex
import signal
import subprocess
import tempfile
import time
from typing import Any

import rclpy
from rclpy.executors import SingleThreadedExecutor
from rclpy.signals import SignalHandlerOptions

from scenario_gen.base.errors import InputError
from scenario_gen.base.interrupts import ending
from scenario_gen.closed_loop.config import ClosedLoopConfig
from scenario_gen.closed_loop.simulation import State
from scenario_gen.closed_loop.trials import Outcome, Trial
from scenario_gen.ros.nodes.traffic import Traffic
from scenario_gen.ros.plumbing.domain import free_domain, this_host_only
from scenario_gen.ros.plumbing.traffic_config import Config

Progress = Callable[[int, int], None]
START = 60.0  # seconds that a planner's node may take until it publishes commands
SETTLE = 1.0  # seconds from its first publisher until it has found the topics that it hears
LAST = 1.0  # seconds in which an answer to a drive's last state is waited for, that it is not taken for the next drive's first
AGAIN = 2.0  # seconds without an answer after which a drive's first state is told again, to who has come late
PATIENCE = 10.0  # seconds that a planner's node has to end by itself
LINES = 8  # of what the planner wrote last, that an error shows


class TrafficOfTrials(Traffic):
    """Drives trials one after the other, each step when the planner has answered the one before."""

    def __init__(self, trials: Sequence[Trial], config: ClosedLoopConfig, progress: Progress) -> None:
        super().__init__(config=Config(lock_step=True, follow_on=False, drive=config))
        self._trials, self._progress = list(trials), progress
        self._told: State | None = None  # the state that was told last, when it was [s], and how many times
        self._told_at, self._tellings = 0.0, 0

    @property
    def outcomes(self) -> list[Outcome]:
        """What the trials came to, so far."""
        return self._outcomes

    def steered(self) -> bool:
        """Whether somebody publishes commands."""
        return bool(self._commanding())

    def _tell(self) -> None:
        """Tell the last state; once more only if nobody has answered for `AGAIN`, for each telling may be answered."""
        at, state = time.monotonic(), self._states[-1]
        if state is not self._told:
            self._told, self._tellings = state, 0
        elif at < self._told_at + AGAIN:
            return
        self._told_at, self._tellings = at, self._tellings + 1
        super()._tell()

    async def drive_all(self) -> None:
        """Drive all trials."""
        for number in range(len(self._trials)):
            self._load(number)
            loop = self._loop
            await self._answered(self._states[-1], self.config.patience)
            if self._tellings > 1:
                await self._silence(LAST)
            while loop is not None and not self._verdict:
                await self._step_once(loop)
            self._progress(number + 1, len(self._trials))
            await self._answered(self._states[-1], LAST)

    async def _silence(self, duration: float) -> None:
        """Return after `duration` [s] of real time, in which commands are heard; what came last counts."""
        until = time.monotonic() + duration
        while time.monotonic() < until:
            await self._next_command(until)


def drive_over_dds(trials: Sequence[Trial], command: str, config: ClosedLoopConfig, progress: Progress) -> list[Outcome]:
    """Drive the node that a command starts through every trial; results are in the order of the trials.

    Args:
        trials: what is driven.
        command: starts the planner's node, e.g. `ros2 run my_package my_planner`; words are parted as by a shell.
        config: the parameters of a drive.
        progress: told how many are done, and how many there are.

    Raises:
        InputError: the command cannot be run, its node publishes no command, or ends before the drives do.
        RefusedError: no ROS domain is free.
    """
    words = shlex.split(command)
    if not words:
        raise InputError("--planner is empty; with --ros it is a command that starts the planner's node")
    with free_domain() as domain, _environment(domain), tempfile.TemporaryFile() as said:
        rclpy.init(args=[], signal_handler_options=SignalHandlerOptions.NO)
        try:
            process = subprocess.Popen(words, stdout=said, stderr=subprocess.STDOUT, start_new_session=True)
        except OSError as error:
            rclpy.try_shutdown()
            raise InputError(f"--planner {command}: {error}") from error
        try:
            with ending(lambda: _end(process)):
                return _driven(trials, command, config, progress, process, said)
        finally:
            _end(process)
            rclpy.try_shutdown()


def _end(process: "subprocess.Popen[bytes]") -> None:
    """End a planner's process and all that it has started (`ros2 run` and `ros2 launch` start others)."""
    for number in (signal.SIGTERM, signal.SIGKILL):
        with suppress(ProcessLookupError):
            os.killpg(process.pid, number)
        with suppress(subprocess.TimeoutExpired):
            process.wait(PATIENCE)


@contextmanager
def _environment(domain: int) -> Iterator[None]:
    """Set what puts this process and its children in a ROS domain on this host."""
    own = {**this_host_only(), "ROS_DOMAIN_ID": str(domain)}
    before = {name: os.environ.get(name) for name in own}
    os.environ.update(own)
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                os.environ.pop(name, None)
            else:
                os.environ[name] = value


def _driven(
    trials: Sequence[Trial], command: str, config: ClosedLoopConfig, progress: Progress, process: Any, said: Any
) -> list[Outcome]:
    def check() -> None:
        if process.poll() is not None:
            said.seek(0)
            lines = said.read().decode(errors="replace").splitlines()[-LINES:]
            raise InputError(f"--planner {command}: it ended with code {process.returncode}; it said: {' | '.join(lines)}")

    node, executor = TrafficOfTrials(trials, config, progress), SingleThreadedExecutor()
    executor.add_node(node)
    try:
        until = time.monotonic() + START
        while not node.steered():
            check()
            if time.monotonic() > until:
                raise InputError(
                    f"--planner {command}: no command from it in {START:.0f} s; it must publish one of ego/cmd_vel, "
                    "ego/cmd_vel_stamped, ego/trajectory, ego/path, ego/odom (docs/closed_loop.md)"
                )
            executor.spin_once(timeout_sec=0.05)
        until = time.monotonic() + SETTLE
        while time.monotonic() < until:
            executor.spin_once(timeout_sec=0.05)
        task = executor.create_task(node.drive_all)
        while not task.done():
            check()
            executor.spin_once(timeout_sec=1.0)  # spin_until_future_complete of rclpy 7.1 leaves a task for each time it looked
        task.result()
        return node.outcomes
    finally:
        node.destroy_node()
        executor.shutdown(timeout_sec=1.0)
