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

"""The life of a process of nodes: made, started, spun, and ended by a signal or because all is done.

Signals are heard by a thread of their own (`scenario_gen/interrupts.py`), and rclpy's handlers are not installed: nothing is
raised in the midst of a callback, and the context is valid until the nodes have ended.
"""

from collections.abc import Callable, Sequence
from contextlib import suppress
import os
from pathlib import Path
import sys
import threading
import traceback
from typing import Any, NoReturn

import rclpy
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.signals import SignalHandlerOptions

from scenario_gen.compiling import end_workers
from scenario_gen.errors import ScenarioGenError, tell
from scenario_gen.interrupts import end_orderly, ending, hear
from scenario_gen.nodes.answering import Answers
from scenario_gen.nodes.compiling import Preparation
from scenario_gen.nodes.usage import asks_for_help, help_of, namespaces, show

Maker = Callable[[str | None], Any]


def run_nodes(make: Maker | Sequence[Maker], arguments: Sequence[str] | None = None) -> int:
    """Spin one node (or one of each) per `--namespace` until Ctrl-C, SIGTERM, SIGHUP, or all are done; end the process.

    Returns:
        The exit code, but only where there was nothing to be spun.
    """
    arguments = sys.argv if arguments is None else arguments
    makers = (make,) if callable(make) else make
    if asks_for_help(arguments):
        show(help_of(Path(arguments[0]).name, makers))
        return 0
    where = namespaces(arguments)
    hear()
    rclpy.init(args=list(arguments), signal_handler_options=SignalHandlerOptions.NO)
    executor = SingleThreadedExecutor()
    nodes: list[Any] = []
    code = 0
    with ending(end_workers):
        try:
            for namespace in where:
                for one in makers:
                    nodes.append(one(namespace))
                    Answers(nodes[-1])
                    executor.add_node(nodes[-1])
            code = _spin(executor, nodes)
        except ExternalShutdownException:
            pass
        except (ScenarioGenError, OSError) as error:
            code = tell(error)
        except Exception:
            traceback.print_exc()
            code = 1
        end_orderly(lambda: None)  # a Ctrl-C does not disturb the clean end
        end_workers()
        code = max(code, _end(nodes, executor))
    return _leave(code)


def _spin(executor: SingleThreadedExecutor, nodes: Sequence[Any]) -> int:
    """Start the nodes, once their kernels are there, and spin them; return the exit code."""
    asked = threading.Event()

    def end() -> None:
        asked.set()
        executor.create_task(lambda: None)  # so that it looks up

    def start() -> None:
        for node in nodes:
            if not asked.is_set():
                node.autostart()

    end_orderly(end)
    with_kernels = [node for node in nodes if getattr(node, "STAGES", ())]
    if with_kernels:
        Preparation(executor, with_kernels, start)
    else:
        start()
    while not asked.is_set() and rclpy.ok() and not all(getattr(node, "done", False) for node in nodes):
        executor.spin_once()
    return max(getattr(node, "exit_code", 0) for node in nodes)


def _end(nodes: Sequence[Any], executor: SingleThreadedExecutor) -> int:
    """Destroy the nodes, whatever one of them says to it; return the exit code."""
    code = 0
    for node in nodes:
        getattr(node, "cancel", list)()  # all at once, so that none is waited for before another is told
    for node in nodes:
        try:
            node.destroy_node()
        except (ScenarioGenError, OSError) as error:  # a bag that cannot be closed, say
            code = tell(error)
    executor.shutdown(timeout_sec=1.0)
    for node in nodes:
        # rclpy lets it keep its node, so that others would not hear of the end for 20 s
        if (machine := getattr(node, "_state_machine", None)) is not None:
            machine.destroy_when_not_in_use()
    rclpy.try_shutdown()
    return code


def _leave(code: int) -> NoReturn:
    """End the process: all that matters is closed, and to take Python and the compiler down costs half a second of the CPU."""
    for stream in (sys.stdout, sys.stderr):
        with suppress(OSError, ValueError):
            stream.flush()
    os._exit(code)
