# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""traffic for `scenario-gen drive --ros`: the node drives trial after trial in lock-step with a planner that is a node, too."""

from collections.abc import Callable, Sequence
from time import monotonic

import rclpy
from rclpy.executors import SingleThreadedExecutor
from rclpy.signals import SignalHandlerOptions

from scenario_gen.base.errors import InputError
from scenario_gen.closed_loop.config import ClosedLoopConfig
from scenario_gen.closed_loop.simulation import State
from scenario_gen.closed_loop.trials import Outcome, Trial
from scenario_gen.ros.nodes.traffic import Traffic
from scenario_gen.ros.plumbing.driving import Config, INPUTS

Progress = Callable[[int, int], None]
START = 60.0  # seconds that a planner's node may take until it publishes commands
SETTLE = 1.0  # seconds from its first publisher until it has found the topics that it hears
LAST = 1.0  # seconds in which an answer to a drive's last state is waited for, that it is not taken for the next drive's first
AGAIN = 2.0  # seconds without an answer after which a drive's first state is sent again, to who has come late


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
        at, state = monotonic(), self._states[-1]
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
        until = monotonic() + duration
        while monotonic() < until:
            await self._next_command(until)


def drive_trials(
    trials: Sequence[Trial], config: ClosedLoopConfig, progress: Progress, planner: str, check: Callable[[], None]
) -> list[Outcome]:
    """Drive a planner that is a node through every trial, each step when it has answered; results are in the trials' order.

    Args:
        trials: what is driven.
        config: the parameters of a drive.
        progress: called with how many are done, and how many there are.
        planner: its command, which the error names.
        check: called while the planner is waited for; it raises when the planner's process has ended.

    Raises:
        InputError: the planner publishes no command.
    """
    rclpy.init(args=[], signal_handler_options=SignalHandlerOptions.NO)
    try:
        node, executor = TrafficOfTrials(trials, config, progress), SingleThreadedExecutor()
        executor.add_node(node)
        try:
            until = monotonic() + START
            while not node.steered():
                check()
                if monotonic() > until:
                    ways = ", ".join(INPUTS)
                    raise InputError(
                        f"--planner {planner}: no command from it in {START:.0f} s; it must publish one of {ways} "
                        "(docs/closed_loop.md)"
                    )
                executor.spin_once(timeout_sec=0.05)
            until = monotonic() + SETTLE
            while monotonic() < until:
                executor.spin_once(timeout_sec=0.05)
            task = executor.create_task(node.drive_all)
            while not task.done():
                check()
                executor.spin_once(timeout_sec=1.0)  # spin_until_future_complete of rclpy 7.1 leaves a task for each look
            task.result()
            return node.outcomes
        finally:
            node.destroy_node()
            executor.shutdown(timeout_sec=1.0)
    finally:
        rclpy.try_shutdown()
