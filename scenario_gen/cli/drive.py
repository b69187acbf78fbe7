# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Drives of a planner that is a ROS 2 node, over DDS in lock-step: `scenario-gen drive --ros`.

The node `traffic` runs in this process and takes a step after each answer of the planner. The
planner can be any node that answers each odometry message with one command. It is started by a
command, in a ROS domain of its own.
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


def drive_over_dds(
    trials: Sequence[Trial],
    command: str,
    config: ClosedLoopConfig,
    progress: Callable[[int, int], None],
) -> list[Outcome]:
    """Drive a planner's node through every trial; the results are in the order of the trials.

    Args:
        trials: the drives to make.
        command: starts the planner's node, e.g. `ros2 run my_package my_planner`.
        config: the parameters of a drive.
        progress: called with the number of finished drives and of all drives.

    Raises:
        InputError: the command cannot be run, its node publishes no command, or it ends too early.
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
                lines = output.read().decode(errors="replace").splitlines()[-8:]
                raise InputError(
                    f"--planner {command}: the command ended with code {process.returncode}; "
                    f"its last output: {' | '.join(lines)}"
                )

        try:
            with cleaned_up(lambda: _end(process)):
                return drive_trials(trials, config, progress, command, check)
        finally:
            _end(process)


def _end(process: "subprocess.Popen[bytes]") -> None:
    """End a planner's process and its children (`ros2 run` and `ros2 launch` start some)."""
    for number in (signal.SIGTERM, signal.SIGKILL):
        with suppress(ProcessLookupError):
            os.killpg(process.pid, number)
        with suppress(subprocess.TimeoutExpired):
            process.wait(10.0)
