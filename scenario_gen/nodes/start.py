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

"""The executables. Each listens to signals first, so that Ctrl-C while the libraries load ends it at once."""

from functools import partial
import importlib

from scenario_gen.interrupts import hear


def start(name: str) -> None:
    """Load the node `name` and run it."""
    hear()
    importlib.import_module(f"scenario_gen.nodes.{name}").main()


segmenter = partial(start, "segmenter")
planner = partial(start, "planner")
gp_sampler = partial(start, "gp_sampler")
road_server = partial(start, "road_server")
log_player = partial(start, "log_player")
evaluator = partial(start, "evaluator")
recorder = partial(start, "recorder")
player = partial(start, "player")
suite = partial(start, "suite")

if __name__ == "__main__":
    import sys

    start(sys.argv.pop(1))
