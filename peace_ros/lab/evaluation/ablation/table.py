# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Figures of an ablation as Markdown, and their place in a document."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from peace_ros.core.domain import ConfigurationError
from peace_ros.lab.evaluation.ablation.figures import RECALL, Figures
from peace_ros.lab.evaluation.ablation.variants import DEFAULT, GROUPS, VOCABULARY, WORDS
from peace_ros.lab.evaluation.segmentation.table import percent
from peace_ros.lab.markdown import markdown_table

BEGIN, END = '<!-- ablation: begin -->', '<!-- ablation: end -->'
_COLUMNS = (
    'best mIoU',
    'against default',
    'average precision',
    f'false-safe at {RECALL:.0%} recall',
    'mIoU',
    'false-safe',
    'recall',
)
_RATES = ('average_precision', 'false_safe_at_recall', 'miou', 'false_safe', 'recall')
_TITLES = {
    'vocabulary': 'Vocabularies',
    'template': 'Templates',
    'environment words': 'Number of environment words',
}


def markdown(figures: Figures, title: str) -> str:
    """Return the tables, in per cent, the default in bold."""
    fusion = figures['fusion']
    rows = figures['variants']
    default = next(row for row in rows if row['is_default'])
    explained = (
        f'{title}; {figures["frames"]} frames, {figures["configuration"]} with '
        f'{figures["bundle"]}. Per cent. *Best mIoU*: at the threshold that is best for the row on '
        'these frames; *against default*: its difference in points, with a 95 % interval over '
        'frames; the last three columns: at the shipped threshold (at a score of one half for '
        'soft and softmax).'
    )
    parts = [explained]
    for group in GROUPS:
        chosen = [row for row in rows if row['group'] == group and row['fusion'] == fusion]
        if group != VOCABULARY:
            chosen.append({**default, 'variant': _default_name(group)})
            chosen.sort(key=lambda row: (group == WORDS or not row['is_default'], row['variant']))
        parts.append(_table(_TITLES[group], [(row['variant'], row) for row in chosen]))
    fusions = [row for row in rows if (row['group'], row['variant']) == (VOCABULARY, DEFAULT)]
    parts.append(_table('Fusion', [(row['fusion'], row) for row in fusions]))
    parts.append(_thresholds(figures['thresholds']))
    return '\n\n'.join(parts) + '\n'


def _default_name(group: str) -> str:
    return 'PEACE' if group == 'template' else '1'


def _table(title: str, rows: list[tuple[str, Figures]]) -> str:
    return markdown_table(
        (title, *_COLUMNS),
        'l' + 'r' * len(_COLUMNS),
        (
            (
                f'**{name}**' if row['is_default'] else name,
                percent(row['best_miou']),
                '' if row['is_default'] else _difference(row),
                *(percent(row[key]) for key in _RATES),
            )
            for name, row in rows
        ),
    )


def _difference(row: Figures) -> str:
    value, interval = row['difference'], row['difference_interval']
    if value is None:
        return '-'
    text = f'{100 * value:+.1f}'
    if interval is None:
        return text
    return f'{text} ({100 * interval[0]:+.1f} to {100 * interval[1]:+.1f})'


def _thresholds(rows: list[dict[str, Any]]) -> str:
    return markdown_table(
        ('Threshold', 'mIoU', 'false-safe', 'recall', 'person called safe'),
        'lrrrr',
        (
            (
                f'**{row["threshold"]:.3f}**' if row['is_default'] else f'{row["threshold"]:.3f}',
                *(percent(row[key]) for key in ('miou', 'false_safe', 'recall', 'person')),
            )
            for row in rows
        ),
    )


def put_into(document: Path, text: str) -> None:
    """Replace what stands between the marks of a document.

    Raises ConfigurationError when the document has no marks or cannot be read.
    """
    try:
        content = document.read_text(encoding='utf-8')
    except OSError as error:
        raise ConfigurationError(f'{document}: {error.strerror}') from error
    before, begin, rest = content.partition(BEGIN)
    _, end, after = rest.partition(END)
    if not begin or not end:
        raise ConfigurationError(f'{document}: has no lines {BEGIN} and {END}: add them')
    document.write_text(f'{before}{BEGIN}\n\n{text}\n{END}{after}', encoding='utf-8')
