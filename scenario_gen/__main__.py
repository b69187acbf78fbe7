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

import os
import signal
import sys

from scenario_gen.interrupts import interrupt, Interrupted

SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)


def _leave(number: int, _frame: object) -> None:
    """While the libraries load there is nothing to clean up, and some of them swallow exceptions."""
    os.write(2, f"{Interrupted(number)}\n".encode())
    os._exit(128 + number)


def main() -> None:
    """Run the command line."""
    heard = [number for number in SIGNALS if signal.getsignal(number) is not signal.SIG_IGN]  # nohup, or a job in the background
    for number in heard:
        signal.signal(number, _leave)
    from scenario_gen.cli import main as run

    code: int | str | None = 0
    try:
        for number in heard:
            signal.signal(number, interrupt)
        run()
    except Interrupted as stopped:
        print(stopped, file=sys.stderr)
        code = stopped.exit_code
    except SystemExit as end:
        code = end.code
    for number in heard:
        signal.signal(number, _leave)  # while the interpreter ends
    sys.exit(code)


if __name__ == "__main__":
    main()
