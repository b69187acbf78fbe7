# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""traffic for `scenario-gen drive --ros`.

Drives all trials in lock-step with a planner that is a node.
"""

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from time import monotonic

import rclpy
from rclpy.executors import SingleThreadedExecutor
from rclpy.signals import SignalHandlerOptions

from scenario_gen.base.errors import InputError
from scenario_gen.closed_loop.config import ClosedLoopConfig
from scenario_gen.closed_loop.origin import Trial
from scenario_gen.closed_loop.simulation import State
from scenario_gen.closed_loop.trials import Outcome, rates
from scenario_gen.ros.common.driving import Config, INPUTS
from scenario_gen.ros.nodes.traffic import Traffic

START_TIMEOUT_S = 60.0  # until a planner's node publishes commands
DISCOVERY_S = 1.0  # from its first publisher until it has found the topics that it subscribes to
LAST_REPLY_S = (
    1.0  # to wait for a reply to a drive's last state, which must not reach the next drive
)
SILENCE_TIMEOUT_S = 30.0  # without a command, after which a planner's node hangs
REPEAT_PERIOD_S = 2.0  # without a reply, after which a drive's first state is sent again
POLL_S = 0.05
Progress = Callable[[int, int], None]


class TrialTraffic(Traffic):
    """Drives trials one after the other; each step waits for the planner's reply."""

    is_local = True

    def __init__(
        self, trials: Sequence[Trial], config: ClosedLoopConfig, progress: Progress
    ) -> None:
        super().__init__(config=Config(lock_step=True, follow_on=False, drive=config))
        self._trials = list(trials)
        self._progress = progress
        self._sent: State | None = None  # the last published state
        self._sent_at = 0.0  # when it was published, on the steady clock [s]
        self._sent_count = 0

    def _publish_state(self) -> None:
        """Publish the last state; repeat it only after a while.

        The planner may reply to each copy.
        """
        now = monotonic()
        state = self._states[-1]
        if state is not self._sent:
            self._sent = state
            self._sent_count = 0
        elif now < self._sent_at + REPEAT_PERIOD_S:
            return
        self._sent_at = now
        self._sent_count += 1
        super()._publish_state()

    async def drive_all(self) -> None:
        """Drive all trials."""
        for number in range(len(self._trials)):
            self._load(number)
            loop = self._loop
            start = monotonic()
            await self._wait_for_command(self._states[-1], self.config.patience)
            if self._sent_count > 1:  # each copy may get a reply, of which the last one counts
                await self.waits.until(lambda: False, monotonic() + LAST_REPLY_S)
            while loop is not None and not self._verdict:
                await self._step_once(loop)
                self._check_time(self._trials[number], start)
            self._progress(number + 1, len(self._trials))
            await self._wait_for_command(self._states[-1], LAST_REPLY_S)

    def _check_time(self, trial: Trial, start: float) -> None:
        """Raise InputError if a drive takes too long, or the planner is silent for too long."""
        now = monotonic()
        if now - start > self.config.drive.drive_time:
            raise InputError(
                f"scenario {trial.name}: the planner did not finish in "
                f"{self.config.drive.drive_time:g} s; if it does not hang, increase drive_time"
            )
        if now - max(start, self._last_reply_at) > SILENCE_TIMEOUT_S:
            raise InputError(
                f"scenario {trial.name}: the planner's node has sent no command for "
                f"{SILENCE_TIMEOUT_S:.0f} s: it hangs, "
                "or does not answer each odometry of the ego with one command"
            )


@contextmanager
def _summary_on_error(outcomes: Sequence[Outcome]) -> Iterator[None]:
    """Add the summary of the drives before it to an InputError."""
    try:
        yield
    except InputError as error:
        if not outcomes:
            raise
        summary = ", ".join(f"{name} {rate.count}" for name, rate in rates(outcomes).items())
        raise InputError(f"{error}; of the {len(outcomes)} drives before: {summary}") from error


def _drive_all(
    node: TrialTraffic, executor: SingleThreadedExecutor, check: Callable[[], None]
) -> None:
    """Drive all trials, and call `check` meanwhile."""
    task = executor.create_task(node.drive_all)
    while not task.done():
        check()
        # rclpy's spin_until_future_complete (7.1) leaves a task behind at each call.
        executor.spin_once(timeout_sec=1.0)
    task.result()


def drive_trials(
    trials: Sequence[Trial],
    config: ClosedLoopConfig,
    progress: Progress,
    planner: str,
    check: Callable[[], None],
) -> list[Outcome]:
    """Drive a planner's node through all trials in lock-step; return their outcomes.

    Args:
        trials: scenarios, each with an ego and a road.
        config: the parameters of a drive.
        progress: called with the number of finished trials and the number of all.
        planner: its command, for the error.
        check: called while waiting for the planner; it raises when the planner's process has
            ended.

    Raises:
        InputError: the planner publishes no command, or none any more, or takes longer than
            `drive_time` for a drive.
    """
    rclpy.init(args=[], signal_handler_options=SignalHandlerOptions.NO)
    try:
        node = TrialTraffic(trials, config, progress)
        executor = SingleThreadedExecutor()
        executor.add_node(node)
        try:
            _wait_for_planner(node, executor, planner, check)
            with _summary_on_error(node.outcomes):
                _drive_all(node, executor, check)
            return node.outcomes
        finally:
            node.destroy_node()
            executor.shutdown(timeout_sec=1.0)
    finally:
        rclpy.try_shutdown()


def _wait_for_planner(
    node: TrialTraffic,
    executor: SingleThreadedExecutor,
    planner: str,
    check: Callable[[], None],
) -> None:
    """Wait until the planner publishes commands and has found the topics that it subscribes to."""
    deadline = monotonic() + START_TIMEOUT_S
    while not node.commanding_nodes():
        check()
        if monotonic() > deadline:
            raise InputError(
                f"--planner {planner}: no command from it in {START_TIMEOUT_S:.0f} s; it must "
                "publish one of "
                f"{', '.join(INPUTS)} (docs/closed_loop.md)"
            )
        executor.spin_once(timeout_sec=POLL_S)
    deadline = monotonic() + DISCOVERY_S
    while monotonic() < deadline:
        executor.spin_once(timeout_sec=POLL_S)
