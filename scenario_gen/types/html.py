# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Values as HTML for notebooks."""

from collections.abc import Iterable, Sequence
from html import escape


def html_table(title: str, rows: Iterable[Sequence[str]]) -> str:
    """Return a table below a title in bold, the header first; all texts are escaped."""
    lines = [f"<tr>{''.join(f'<td>{escape(cell)}</td>' for cell in row)}</tr>" for row in rows]
    return f"<b>{escape(title)}</b><table>{''.join(lines)}</table>"


def html_list(lines: Iterable[str]) -> str:
    """Return an unordered list of texts, which are escaped."""
    return f"<ul>{''.join(f'<li>{escape(line)}</li>' for line in lines)}</ul>"
