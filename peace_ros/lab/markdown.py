# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Tables in Markdown."""

from __future__ import annotations

from collections.abc import Iterable, Sequence


def markdown_table(header: Sequence[str], columns: str, rows: Iterable[Sequence[str]]) -> str:
    """Return a table without a line break at its end.

    Args:
        header: titles of the columns.
        columns: for each an ``l`` or an ``r``: where it is aligned.
        rows: cells; a bar in them stays a bar.
    """
    ruler = '|'.join({'l': '---', 'r': '---:'}[each] for each in columns)
    lines = [' | '.join(cell.replace('|', '\\|') for cell in row) for row in (header, *rows)]
    return '\n'.join([f'| {lines[0]} |', f'|{ruler}|', *(f'| {line} |' for line in lines[1:])])
