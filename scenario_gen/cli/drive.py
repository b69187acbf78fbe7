# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""A planner that is a ROS 2 node of its own, driven through many scenarios over DDS in lock-step: `scenario-gen drive --ros`.

The node `traffic` runs in this process, and steps when the planner has answered: any node does that answers each odometry with
one command. The planner is started as a command, in a ROS domain in which nobody else is.
"""

from collections.abc import Callable, Sequence
from contextlib import suppress
import os
import shlex
import signal
import subprocess
import tempfile

from scenario_gen.base.errors import InputError
from scenario_gen.base.ros_domain import own_domain
from scenario_gen.base.signals import cleaned_up
from scenario_gen.closed_loop.config import ClosedLoopConfig
from scenario_gen.closed_loop.origin import Trial
from scenario_gen.closed_loop.trials import Outcome
from scenario_gen.ros.common.planner_trials import drive_trials

END_S = 10.0  # seconds that a planner's node has to end by itself
LINES = 8  # of what the planner wrote last, that an error shows


def drive_over_dds(
    trials: Sequence[Trial],
    command: str,
    config: ClosedLoopConfig,
    progress: Callable[[int, int], None],
) -> list[Outcome]:
    """Drive the node that a command starts through every trial; results are in the order of the trials.

    Args:
        trials: what is driven.
        command: starts the planner's node, e.g. `ros2 run my_package my_planner`; words are parted as by a shell.
        config: the parameters of a drive.
        progress: called with how many are done, and how many there are.

    Raises:
        InputError: the command cannot be run, its node publishes no command, or ends before the drives do.
        RefusedError: no ROS domain is free.
    """
    words = shlex.split(command)
    if not words:
        raise InputError(
            "--planner is empty; with --ros, give the command that starts the planner's node"
        )
    with own_domain(), tempfile.TemporaryFile() as output:
        try:
            process = subprocess.Popen(
                words, stdout=output, stderr=subprocess.STDOUT, start_new_session=True
            )
        except OSError as error:
            raise InputError(f"--planner {command}: {error}") from error

        def check() -> None:
            if process.poll() is not None:
                output.seek(0)
                lines = output.read().decode(errors="replace").splitlines()[-LINES:]
                raise InputError(
                    f"--planner {command}: the command ended with code {process.returncode}; its last output: {' | '.join(lines)}"
                )

        try:
            with cleaned_up(lambda: _end(process)):
                return drive_trials(trials, config, progress, command, check)
        finally:
            _end(process)


def _end(process: "subprocess.Popen[bytes]") -> None:
    """End a planner's process and all that it has started (`ros2 run` and `ros2 launch` start others)."""
    for number in (signal.SIGTERM, signal.SIGKILL):
        with suppress(ProcessLookupError):
            os.killpg(process.pid, number)
        with suppress(subprocess.TimeoutExpired):
            process.wait(END_S)
