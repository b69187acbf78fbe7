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

"""The terminal: what files, vehicles and encounters are called is shown letter by letter, whatever the letters are."""

from typing import Any

from rich.console import Console
from rich.text import Text

from scenario_gen.errors import printable


class Terminal(Console):
    """A console that takes no text for markup and lets no control character out of one; styles come with Text objects only."""

    def __init__(self, **options: Any) -> None:
        super().__init__(markup=False, emoji=False, highlight=False, **options)

    def render_str(self, text: str, **options: Any) -> Text:
        """Every plain text goes this way, in a table's cell, too."""
        return super().render_str(printable(text), **options)
