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

"""BLAS on one thread: for matrices as small as ours a second one spins more than it computes, and makes calls slower."""

from collections.abc import Callable
from functools import cache, wraps
from typing import Any, cast, TypeVar

from threadpoolctl import ThreadpoolController

Function = TypeVar("Function", bound=Callable[..., Any])


@cache
def _libraries() -> ThreadpoolController:
    """Every BLAS of this process; found at the first call, when numpy and scipy have loaded theirs."""
    return ThreadpoolController().select(user_api="blas")


def on_one_thread(function: Function) -> Function:
    """Run the function with BLAS on one thread, whatever the process has set; 0.05 ms a call.

    Measured on two cores: a regression of 200 points took 12 ms of CPU (6 ms on the clock) with two threads, 1.8 ms with one.
    """

    @wraps(function)
    def limited(*args: Any, **kwargs: Any) -> Any:
        with _libraries().limit(limits=1):
            return function(*args, **kwargs)

    return cast(Function, limited)
