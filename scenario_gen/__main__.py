# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The executable `scenario-gen`; it handles signals before it loads any library."""

import gc
import os
import sys

from scenario_gen import __version__
from scenario_gen.base.errors import MissingExtraError, needs
from scenario_gen.base.signals import handle_signals


def main() -> None:
    """Run the command line."""
    # Before numpy is loaded: the matrices are small, and BLAS threads would only wait.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    handle_signals()
    # Libraries make a million objects while they load, and no garbage.
    gc.set_threshold(50_000)
    if sys.argv[1:] == ["--version"]:  # without any extra, too
        print(f"scenario-gen {__version__}")
        return
    try:
        needs("cli", "rich", "typer")
        from scenario_gen.cli.commands import main as run
    except MissingExtraError as error:
        sys.exit(f"error: {error}")

    # The resource tracker warns when it removes the resources of a killed process.
    sys.warnoptions.append("ignore:resource_tracker")
    run()


if __name__ == "__main__":
    main()
