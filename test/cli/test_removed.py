# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Commands and options of earlier drafts: one line that names what replaces them."""

import pytest

from scenario_gen.base.errors import InputError
from scenario_gen.base.removed import REMOVED
from scenario_gen.cli.commands import run


@pytest.mark.parametrize("name", REMOVED)
def test_what_was_removed_names_its_replacement(name):
    words = [name]
    if name.startswith("--"):
        words = ["generate", "log.csv", name, "3"]
    elif name.endswith("://"):
        words = ["mine", f"{name}bucket/archive", "--out", "corpus"]
    with pytest.raises(InputError, match=f"^{name} was removed: [^\n]+$"):
        run(words)


def test_a_folder_with_the_name_of_a_removed_command_is_no_command():
    with pytest.raises(InputError, match="library"):
        run(["validate", "library"])
