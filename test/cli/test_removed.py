# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Commands and options of earlier drafts: one line that names what replaces them."""

import re

import pytest

from scenario_gen.base.errors import InputError
from scenario_gen.base.removed import REMOVED
from scenario_gen.cli.commands import run


@pytest.mark.parametrize("name", REMOVED)
def test_what_was_removed_names_its_replacement(name, tmp_path):
    words, log = [name], tmp_path / f"log{name if name.startswith('.') else '.csv'}"
    log.write_text("<x/>")
    if name.startswith("."):
        words = ["generate", str(log), "--road", "corridor"]
    elif name.startswith("log.format="):
        words = ["generate", str(log), "--road", "corridor", "--set", name]
    elif name.startswith("--to "):
        words = ["export", str(tmp_path), *name.split()]
    elif name.startswith("--"):
        words = ["generate", "log.csv", name, "3"]
    elif name.endswith("://"):
        words = ["mine", f"{name}bucket/archive", "--out", "corpus"]
    with pytest.raises(InputError, match=f"{re.escape(name)} was removed: [^\n]+$"):
        run(words)
