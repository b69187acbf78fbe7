# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Every source file begins with two SPDX lines, holder and licence."""

import re

import pytest
from support.source_files import python_files, ROOT

HEADER = re.compile(
    r"(?:#!.*\n+)?# SPDX-FileCopyrightText: \d{4}(?:-\d{4})? \S.*\n# SPDX-License-Identifier: Apache-2\.0\n(?:\n|\Z)"
)


@pytest.mark.copyright
@pytest.mark.linter
def test_source_files_name_holder_and_licence():
    texts = {path: path.read_text(encoding="utf-8") for path in python_files()}
    bare = [
        str(path.relative_to(ROOT))
        for path, text in texts.items()
        if text and not HEADER.match(text)
    ]
    assert not bare, f"without the header of this file: {', '.join(bare)}"
