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

"""The exceptions to the rule that in CI a skipped test has failed (conftest.py)."""

NO_LAUNCH = "launch and launch_testing, or this package as colcon builds it, are not here: source a Jazzy and install/setup.bash"
"""`launch` is not among the Jazzy wheels."""
NO_RECORDS = "recorded data not here"
"""The tests make data of their own; recorded ones are a second judge, where they are."""
MAY_SKIP = (NO_LAUNCH, NO_RECORDS)
