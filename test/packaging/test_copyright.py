# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Every source file begins with two SPDX lines, holder and licence; LICENSE and CONTRIBUTING.md stand beside them."""

import re

import pytest
from source_files import python_files, ROOT

HEADER = re.compile(
    r"(?:#!.*\n+)?# SPDX-FileCopyrightText: \d{4}(?:-\d{4})? \S.*\n# SPDX-License-Identifier: Apache-2\.0\n(?:\n|\Z)"
)


@pytest.mark.copyright
@pytest.mark.linter
def test_every_source_file_names_its_holder_and_licence():
    texts = {path: path.read_text(encoding="utf-8") for path in python_files()}
    bare = [str(path.relative_to(ROOT)) for path, text in texts.items() if text and not HEADER.match(text)]
    assert not bare, f"without the header of this file: {', '.join(bare)}"


@pytest.mark.copyright
@pytest.mark.linter
def test_licence_and_terms_of_contribution():
    terms = (ROOT / "LICENSE").read_text(encoding="utf-8")
    assert "Apache License" in terms and "Version 2.0, January 2004" in terms and "END OF TERMS AND CONDITIONS" in terms
    contributing = " ".join((ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8").split())
    assert "Any contribution that you make to this repository will be under the Apache 2 License" in contributing
    (paragraph,) = re.findall(r"5\. Submission of Contributions\..*?regarding such Contributions\.", " ".join(terms.split()))
    assert paragraph in contributing
