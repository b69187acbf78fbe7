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
from scenario_gen.closed_loop.origin import Trial
from scenario_gen.closed_loop.simulation import State
from scenario_gen.closed_loop.trials import Outcome, saying_what_was_before, too_long
from scenario_gen.ros.common.driving import INPUTS
from scenario_gen.ros.common.node_parameters import TrafficParameters
from scenario_gen.ros.nodes.traffic import Traffic

START_S = 60.0  # seconds that a planner's node may take until it publishes commands
SETTLE_S = 1.0  # seconds from its first publisher until it has found the topics that it listens to
LAST_REPLY_S = 1.0  # to wait for a reply to a drive's last state, which would else count as a reply to the next drive's first
SILENT_S = 30.0  # seconds without a command after which a planner's node hangs
SEND_AGAIN_S = 2.0  # seconds without a reply after which a drive's first state is sent again, for a planner that started late
Progress = Callable[[int, int], None]


class TrafficOfTrials(Traffic):
    """Drives trials one after the other for `scenario-gen drive --ros`; each step waits for the planner's reply."""

    def __init__(
        self, trials: Sequence[Trial], config: ClosedLoopConfig, progress: Progress
    ) -> None:
        super().__init__(config=TrafficParameters(lock_step=True, follow_on=False, drive=config))
        self._trials, self._progress = list(trials), progress
        self._sent: State | None = (
            None  # the state that was published last, when [s], and how many times
        )
        self._sent_at, self._times_sent = 0.0, 0

    def _publish_state(self) -> None:
        """Publish the last state; again only after `AGAIN`, because the planner may reply to each copy."""
        now, state = monotonic(), self._states[-1]
        if state is not self._sent:
            self._sent, self._times_sent = state, 0
        elif now < self._sent_at + SEND_AGAIN_S:
            return
        self._sent_at, self._times_sent = now, self._times_sent + 1
        super()._publish_state()

    async def drive_all(self) -> None:
        """Drive all trials."""
        for number in range(len(self._trials)):
            self._load(number)
            loop, began = self._loop, monotonic()
            await self._wait_for_command(self._states[-1], self.config.patience)
            if self._times_sent > 1:
                until = (
                    monotonic() + LAST_REPLY_S
                )  # each copy may get a reply, of which the last one counts
                while monotonic() < until:
                    await self._next_command(until)
            while loop is not None and not self._verdict:
                await self._step_once(loop)
                self._refuse_hanging(self._trials[number], began)
            self._progress(number + 1, len(self._trials))
            await self._wait_for_command(self._states[-1], LAST_REPLY_S)

    def _refuse_hanging(self, trial: Trial, began: float) -> None:
        """Raise InputError if a drive that `began` then takes too long, or nothing has come of the planner for too long."""
        now = monotonic()
        if now - began > self.config.drive.drive_time:
            raise too_long(trial, self.config.drive)
        if now - max(began, self._heard_at) > SILENT_S:
            raise InputError(
                f"scenario {trial.name}: the planner's node has sent no command for {SILENT_S:.0f} s: it hangs, or does not "
                "answer each odometry of the ego with one command"
            )


def drive_trials(
    trials: Sequence[Trial],
    config: ClosedLoopConfig,
    progress: Progress,
    planner: str,
    check: Callable[[], None],
) -> list[Outcome]:
    """Drive a planner that is a node through every trial, in lock-step; return the outcomes in the trials' order.

    Args:
        trials: scenarios, each with an ego and a road.
        config: the parameters of a drive.
        progress: called with the number of finished trials and the number of all.
        planner: its command, for the error.
        check: called while waiting for the planner; it raises when the planner's process has ended.

    Raises:
        InputError: the planner publishes no command, or none any more, or takes longer than `drive_time` for a drive.
    """
    rclpy.init(args=[], signal_handler_options=SignalHandlerOptions.NO)
    try:
        node, executor = TrafficOfTrials(trials, config, progress), SingleThreadedExecutor()
        executor.add_node(node)
        try:
            until = monotonic() + START_S
            while not node.commanding():
                check()
                if monotonic() > until:
                    raise InputError(
                        f"--planner {planner}: no command from it in {START_S:.0f} s; it must publish one of {', '.join(INPUTS)} "
                        "(docs/closed_loop.md)"
                    )
                executor.spin_once(timeout_sec=0.05)
            until = monotonic() + SETTLE_S
            while monotonic() < until:
                executor.spin_once(timeout_sec=0.05)
            with saying_what_was_before(node.outcomes):
                task = executor.create_task(node.drive_all)
                while not task.done():
                    check()
                    executor.spin_once(
                        timeout_sec=1.0
                    )  # spin_until_future_complete of rclpy 7.1 leaves a task for each look
                task.result()
            return node.outcomes
        finally:
            node.destroy_node()
            executor.shutdown(timeout_sec=1.0)
    finally:
        rclpy.try_shutdown()
