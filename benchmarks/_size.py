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

"""How much a benchmark does: all of it, or with `--quick` next to nothing along the same way, to see that it runs."""

import os
from typing import TypeVar

QUICK = "SCENARIO_GEN_BENCHMARK_QUICK"  # in the environment, so that processes of a benchmark know it too
Size = TypeVar("Size")


def sized(full: Size, quick: Size) -> Size:
    """Return the size that is wanted; figures of the quick one say nothing."""
    return quick if os.environ.get(QUICK) else full
