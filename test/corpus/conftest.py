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

"""One small archive and its corpus for all tests of the folder; they share a worker."""

import pytest

from scenario_gen.corpus.mine import mine
from scenario_gen.corpus.synthetic import ArchiveConfig, write_archive

SMALL = ArchiveConfig(rows=60_000, hours=2.0, encounters=14, outside=6, repeated_ids=0.1, damaged=0.001)


@pytest.fixture(scope="session")
def archive(tmp_path_factory):
    return write_archive(tmp_path_factory.mktemp("archive") / "spmd", SMALL, seed=3)


@pytest.fixture(scope="session")
def corpus(archive, tmp_path_factory):
    out = tmp_path_factory.mktemp("mined") / "corpus"
    return out, mine([archive], out)
