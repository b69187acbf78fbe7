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

"""The kernels of a process's nodes: loaded, or compiled once per machine, before any of the nodes is configured.

A thread sees to it while the nodes are spun. So they answer meanwhile (parameters, get_state: unconfigured) and say on
/diagnostics how far it is; who asks for `configure` waits.
"""

from collections.abc import Callable, Iterable, Sequence
import importlib
import pkgutil
import threading
from time import monotonic, sleep
from typing import Any

from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState
from rclpy.executors import Executor
from rclpy.impl.implementation_singleton import rclpy_implementation

from scenario_gen.compiling import make_ready, Told, words

OFTEN = 5.0  # seconds between two words about it
PAUSE = 0.02  # seconds between two looks of a caller who waits: rclpy's executor does not sleep while one does


def kernels_ready(stages: Iterable[str], told: Told = lambda *_: None) -> tuple[int, float]:
    """Load the kernels of some stages, compile what is not in the cache; return their number and the seconds it took.

    Only those of the node's own stages: to import all of them would cost every node seconds.
    """
    started = monotonic()
    for stage in stages:
        package = importlib.import_module(f"scenario_gen.{stage}")
        for module in pkgutil.iter_modules(getattr(package, "__path__", ())):
            importlib.import_module(f"scenario_gen.{stage}.{module.name}")
    return make_ready(told) if stages else 0, monotonic() - started


class Preparation:
    """Makes the kernels ready and then calls back, on the executor's thread."""

    def __init__(self, executor: Executor, nodes: Sequence[Any], then: Callable[[], None]) -> None:
        """Start. `nodes`: those with stages; their `configure` waits from now on."""
        self._executor, self._nodes, self._then = executor, nodes, then
        self._error: Exception | None = None
        self._ready = False
        self._told = -OFTEN
        for node in nodes:
            for service in node.services:
                if service.srv_type is ChangeState:
                    service.callback = self._once_ready(node, service.callback)
        threading.Thread(target=self._run, daemon=True, name="kernels").start()

    def _run(self) -> None:
        try:
            count, seconds = kernels_ready(dict.fromkeys(stage for node in self._nodes for stage in node.STAGES), self._tell)
            self._nodes[0].get_logger().info(f"{count} kernels ready after {seconds:.1f} s")
        except Exception as error:
            self._error = error
        self._executor.create_task(self._finish)

    def _finish(self) -> None:
        if self._error is not None:
            raise self._error
        self._ready = True
        self._then()

    def _tell(self, done: int, needed: int, seconds: float) -> None:
        if seconds < self._told + OFTEN:
            return
        self._told = seconds
        self._nodes[0].get_logger().info(words(done, needed, seconds))
        for node in self._nodes:
            node.health.state(words(done, needed, seconds))

    def _once_ready(self, node: Any, change: Callable[[Any, Any], Any]) -> Callable[[Any, Any], Any]:
        """Let `configure` wait, and a transition that cannot be be refused: rclpy would end the node."""

        async def changed(request: Any, response: Any) -> Any:
            if request.transition.id == Transition.TRANSITION_CONFIGURE or request.transition.label == "configure":
                while not self._ready:
                    await _Pause()
            try:
                return change(request, response)
            except rclpy_implementation.RCLError as error:
                node.get_logger().warning(f"no such transition now: {error}")
                response.success = False
                return response

        return changed


class _Pause:
    """One turn of the executor."""

    def __await__(self) -> Any:
        sleep(PAUSE)
        yield
