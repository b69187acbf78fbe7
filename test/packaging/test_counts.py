# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""The counts of docs/architecture.md are those of the sources."""

import counts
from counts import floors, is_kernel, parameters, Source, up_or_mutual, written


def test_the_page_is_up_to_date():
    page = (counts.ROOT / "docs" / "architecture.md").read_text(encoding="utf-8")
    assert page == written(page), "the counts are stale: run `make counts`"


def test_what_is_counted():
    text = '"""Doc."""\n\n# comment\nx = 1\n\n\n@kernel(F)\ndef f(a, *, b):\n    """Doc."""\n    return (a +\n            b)\n'
    source = Source(counts.ROOT, "base", text)
    (function,) = source.functions
    assert source.code_lines == 5
    assert parameters(function) == 2 and is_kernel(function)
    assert floors({("a", "b"), ("b", "c"), ("a", "c")}) == 3
    assert up_or_mutual({("b", "a"), ("c", "a"), ("b", "c"), ("c", "b")}, "abc") == {("b", "c"), ("c", "b")}
    assert up_or_mutual({("a", "b"), ("c", "a")}, "abc") == {("a", "b")}
