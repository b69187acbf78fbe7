# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The executable `scenario-gen`. It sets the signals first, so that Ctrl-C and SIGTERM end it without a traceback at any time."""

import atexit
from contextlib import suppress
import os
import signal
import sys

from scenario_gen.base.errors import MissingExtraError, needs
from scenario_gen.base.interrupts import leave, SIGNALS


def command() -> None:
    """Run the command line in a process that goes on."""
    os.environ.setdefault(
        "OPENBLAS_NUM_THREADS", "1"
    )  # before numpy is loaded: matrices are small here, and threads only wait
    for number in SIGNALS:
        if (
            signal.getsignal(number) is not signal.SIG_IGN
        ):  # as for nohup, or a job in the background
            signal.signal(number, leave)
    try:
        needs("cli", "rich", "typer")
        from scenario_gen.base.folders.scratch import sweep_beside
        from scenario_gen.cli.commands import main as run
    except MissingExtraError as error:
        sys.exit(f"error: {error}")

    sys.warnoptions.append(
        "ignore:resource_tracker"
    )  # of the processes of a killed one: it removes what they left, and says so
    sweep_beside(sys.argv[1:])  # what killed commands left
    run()


def main() -> None:
    """Run the command line, and end the process."""
    code: int | None = None

    def end() -> None:
        """End the process: to take Python and the compiler down costs a quarter of a second."""
        if code is not None:
            for stream in (sys.stdout, sys.stderr):
                with suppress(OSError, ValueError):
                    stream.flush()
            os._exit(code)

    atexit.register(end)  # what is registered first runs last
    try:
        command()
    except SystemExit as stop:
        code = stop.code if isinstance(stop.code, int) else int(stop.code is not None)
        raise
    code = 0


if __name__ == "__main__":
    main()
