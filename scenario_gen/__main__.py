# Copyright 2026 The scenario_gen authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""The executable `scenario-gen`. It sets the signals first, so that Ctrl-C and SIGTERM end it without a traceback at any time."""

import atexit
from contextlib import suppress
import os
import signal
import sys
import threading

from scenario_gen.errors import MissingExtraError, needs
from scenario_gen.interrupts import leave, SIGNALS


def command() -> None:
    """Run the command line in a process that goes on."""
    for number in SIGNALS:
        if signal.getsignal(number) is not signal.SIG_IGN:  # as for nohup, or a job in the background
            signal.signal(number, leave)
    try:
        needs("cli", "rich", "typer")
        from scenario_gen.cli import main as run
        from scenario_gen.folders.scratch import sweep_beside
    except MissingExtraError as error:
        sys.exit(f"error: {error}")

    sys.warnoptions.append("ignore:resource_tracker")  # of the processes of a killed one: it removes what they left, and says so
    sweep_beside(sys.argv[1:])  # what killed commands left
    run()


def main() -> None:
    """Run the command line, and end the process."""
    try:
        command()
    except SystemExit as end:
        if not isinstance(end.code, int | None):
            raise
        _end(end.code or 0)
    _end(0)


def _end(code: int) -> None:
    """End the process after what was registered for it: to take Python and the compiler down costs a quarter of a second."""
    if threading.active_count() > 1:  # whose work is not done
        sys.exit(code)
    atexit._run_exitfuncs()
    for stream in (sys.stdout, sys.stderr):
        with suppress(OSError, ValueError):
            stream.flush()
    os._exit(code)


if __name__ == "__main__":
    main()
