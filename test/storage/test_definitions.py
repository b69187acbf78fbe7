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

"""The definitions that are kept, against rosbags, which they come from."""

import pytest

from scenario_gen.storage.definitions import definition, kept, type_store


@pytest.mark.parametrize("kind", sorted(kept()))
def test_a_kept_definition_is_that_of_rosbags(kind):
    text, _ = type_store().generate_msgdef(kind, ros_version=2)
    assert definition(kind) == (text, type_store().hash_rihs01(kind))
