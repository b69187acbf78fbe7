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

"""The rule of ament_copyright: a copyright notice and the licence in every source file, LICENSE and CONTRIBUTING.md beside them.

ament_copyright is in no package index, so its rule is written out here; where a Jazzy installation brings it, it runs as well.
"""

import importlib.util
import re

import pytest
from source_files import python_files, ROOT, SOURCES

NOTICE = re.compile(r"# Copyright \d{4}(-\d{4})? \S.*\n#\n")
LICENCE = """\
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
"""


def headed(text: str) -> bool:
    """Whether a file begins with notice and licence; an empty one needs none, a shebang may stand above."""
    text = re.sub(r"\A#!.*\n+", "", text)
    notice = NOTICE.match(text)
    return not text or (notice is not None and text.startswith(LICENCE, notice.end()))


@pytest.mark.copyright
@pytest.mark.linter
def test_every_source_file_names_its_holder_and_licence():
    bare = [str(path.relative_to(ROOT)) for path in python_files() if not headed(path.read_text(encoding="utf-8"))]
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


@pytest.mark.copyright
@pytest.mark.linter
def test_ament_copyright_where_it_is_installed():
    if importlib.util.find_spec("ament_copyright") is not None:
        assert importlib.import_module("ament_copyright.main").main(SOURCES) == 0
