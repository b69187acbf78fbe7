# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""One small archive and its corpus for all tests of the folder; they share a worker."""

import pytest
from synthetic_archive import ArchiveConfig, write_archive

from scenario_gen.corpus.mine import mine

SMALL = ArchiveConfig(
    rows=40_000, hours=2.0, encounters=12, outside=5, repeated_ids=0.1, damaged=0.001
)


@pytest.fixture(scope="session")
def archive(tmp_path_factory):
    return write_archive(tmp_path_factory.mktemp("archive") / "spmd", SMALL, seed=3)


@pytest.fixture(scope="session")
def corpus(archive, tmp_path_factory):
    out = tmp_path_factory.mktemp("mined") / "corpus"
    return out, mine([archive], out)
