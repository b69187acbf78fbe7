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
"""The content security policy of our pages: nothing runs but the scripts that we put there ourselves, named by their hashes.

So a name out of a log stays text, whatever it looks like, even where escaping it were forgotten: no script element, no event
handler and no `javascript:` address is run, `eval` is not to be had, and nothing is asked of any network.
"""

from base64 import b64encode
from collections.abc import Sequence
from hashlib import sha256


def content_policy(scripts: Sequence[str]) -> str:
    """Return the policy of a page with these inline scripts, each given as it stands between its tags.

    Styles stay free ('unsafe-inline'): plotly.js makes style elements and attributes that no hash could name beforehand.
    """
    hashes = " ".join(f"'sha256-{b64encode(sha256(text.encode('utf-8')).digest()).decode('ascii')}'" for text in scripts)
    return (
        f"default-src 'none'; script-src {hashes}; style-src 'unsafe-inline'; img-src data: blob:; font-src data:; "
        "base-uri 'none'; form-action 'none'"
    )
