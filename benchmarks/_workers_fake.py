# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Fake work of the shape of a corpus' tasks: it sleeps, and writes when it began and ended."""

from dataclasses import dataclass
import json
import os
from pathlib import Path
import time
from typing import Any

from scenario_gen.corpus.tasks import arriving


@dataclass(frozen=True)
class FakeTask:
    """A task: its name, the configuration that all have in common, its file, and how long it takes [s]."""

    name: str
    config: Any
    target: Path
    seconds: float


def sleep(task: FakeTask) -> None:
    """Do a task."""
    begun = time.time()
    time.sleep(task.seconds)
    with arriving(task.target) as part:
        part.write_text(
            json.dumps(
                {
                    "worker": os.getpid(),
                    "begun": begun,
                    "ended": time.time(),
                    "known": bool(task.config),
                }
            )
        )
