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

"""The kernels of a node, compiled before it starts to work."""

from collections.abc import Sequence
import importlib
import pkgutil
from time import perf_counter


def compile_kernels(stages: Sequence[str]) -> tuple[int, float]:
    """Compile the kernels of some stages, or load them from the cache; return their number and the seconds it took.

    Only those of the node's own stages: to import all of them would cost every node seconds.
    """
    from scenario_gen import kernels

    started = perf_counter()
    for stage in stages:
        package = importlib.import_module(f"scenario_gen.{stage}")
        for module in pkgutil.iter_modules(getattr(package, "__path__", ())):
            importlib.import_module(f"scenario_gen.{stage}.{module.name}")
    for dispatcher, argument_types in kernels._registry:
        dispatcher.compile(argument_types)
    return len(kernels._registry), perf_counter() - started
