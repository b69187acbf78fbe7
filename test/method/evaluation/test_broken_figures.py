# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Figures (evaluation.json) that once broke the reader or what shows them: an error that names file and path inside it."""

import pytest
from support.crash_files import crash_files, is_refused

from scenario_gen.base.errors import InputError
from scenario_gen.method.evaluation import read_evaluations


@pytest.mark.parametrize("file", crash_files("result/*"), indirect=True)
def test_broken_figures_are_named(file):
    assert is_refused(lambda: read_evaluations(file), str(file))


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "not JSON"),
        ("[]", "the document is"),
        ('{"cases": []}', "cases is"),
        ('{"cases": [{"rows": 3}]}', r"cases\[0\]"),
        ('{"cases": [NaN]}', "NaN is no JSON"),
        ("[" * 100_000, "too deep"),
        ("\xff", "the document is|not JSON"),
        (" " * 9_000_000, "at most"),
        ('{"cases": [{}]}', r"cases\[0\]"),
    ],
    ids=range(9),
)
def test_what_is_wrong_is_named_with_its_path(tmp_path, text, said):
    (tmp_path / "evaluation.json").write_text(text)
    with pytest.raises(InputError, match=rf"evaluation\.json.*({said})"):
        read_evaluations(tmp_path)
