# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""A task for worker processes, in a module that loads next to nothing."""

from dataclasses import dataclass
import errno
import os
from pathlib import Path
import signal

from scenario_gen.base.errors import InputError


def refuse(name):
    if name == "b":
        raise InputError(f"{name} is none")
    if name == "c":
        raise KeyError(name)
    if name == "d":
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), "d.parquet")


@dataclass(frozen=True)
class Counted:
    """A task with a file of its name."""

    name: str
    folder: Path


def write_once(task):
    if (task.folder / task.name).exists():
        raise InputError(f"{task.name} was run before")
    (task.folder / task.name).touch()


def end_worker(task):
    if task.name == "7":
        os.kill(os.getpid(), signal.SIGKILL)
    (task.folder / task.name).touch()
