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

"""Figures (evaluation.json) that once broke the reader or what shows them: an error that names file and path inside it."""

from crash_files import crash_files, is_refused
import pytest

from scenario_gen.errors import InputError
from scenario_gen.evaluation import read_evaluations


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
    ],
    ids=range(8),
)
def test_what_is_wrong_is_named_with_its_path(tmp_path, text, said):
    (tmp_path / "evaluation.json").write_text(text)
    with pytest.raises(InputError, match=rf"evaluation\.json.*({said})"):
        read_evaluations(tmp_path)
