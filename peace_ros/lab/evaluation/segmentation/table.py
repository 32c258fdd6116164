# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Figures for a terminal."""

from __future__ import annotations

from rich.table import Table

from peace_ros.lab.evaluation.segmentation.figures import Figures
from peace_ros.lab.evaluation.segmentation.metrics import HAZARDS
from peace_ros.lab.evaluation.segmentation.run import Outcome

ROWS = (
    ('miou', 'mIoU of safe and unsafe'),
    ('baseline_miou', 'mIoU of "all is unsafe"'),
    ('iou_safe', 'IoU of safe'),
    ('iou_unsafe', 'IoU of unsafe'),
    ('false_safe', 'false-safe: unsafe share of what is called safe'),
    ('recall', 'recall: share of safe ground called safe'),
    ('called_safe', 'share of all ground called safe'),
    ('ece', 'calibration error (ECE)'),
    ('average_precision', 'average precision of safe'),
)
_SHOWN = 5
_FULL = 2
"""Configurations up to which a terminal has room for intervals."""


def percent(value: float | None) -> str:
    """Return a share in per cent, a dash for none."""
    return '-' if value is None else f'{100.0 * value:.1f}'


Cell = tuple[str, list[float] | None]
"""What is shown, and an interval of shares."""
Row = tuple[str, list[Cell]]


def sections(named: dict[str, Figures]) -> tuple[list[Row], list[Row], list[Row], list[Row]]:
    """Return rows with a cell for each configuration: rates, hazards, terms, and counts."""
    every = list(named.values())

    def part(key: str, name: str) -> list[Cell]:
        limits = f'{key}_interval'
        return [(percent(each[key].get(name)), each[limits].get(name)) for each in every]

    rates: list[Row] = [
        (title, [(percent(each[key]), each[f'{key}_interval']) for each in every])
        for key, title in ROWS
    ]
    terms = dict.fromkeys(term for each in every for term in each['iou_by_term'])
    counts: list[Row] = [
        ("threshold (the network's score)", [(f'{e["threshold"]:.3f}', None) for e in every]),
        ('frames (tiles)', [(f'{e["frames"]} ({e["tiles"]})', None) for e in every]),
        (
            'tiles per second',
            [('-' if e['hz'] is None else f'{e["hz"]:.1f}', None) for e in every],
        ),
    ]
    hazards = [(hazard, part('false_safe_by_hazard', hazard)) for hazard in HAZARDS]
    return rates, hazards, [(term, part('iou_by_term', term)) for term in terms], counts


def figures_table(named: dict[str, Figures]) -> Table:
    """Return a table with a column for each configuration; in per cent unless said."""
    full = len(named) <= _FULL
    title = 'per cent, with 95 % intervals over frames' if full else 'per cent'
    table = Table('', title=title, title_justify='left')
    for name in named:
        table.add_column(name, justify='right', no_wrap=True)
    titles = '{}', '{} called safe', 'IoU of "{}"', '{}'
    for words, rows in zip(titles, sections(named), strict=True):
        for name, cells in rows:
            shown = [
                f'{value} ({percent(limits[0])} to {percent(limits[1])})'
                if full and limits
                else value
                for value, limits in cells
            ]
            table.add_row(words.format(name), *shown)
        table.add_section()
    return table


def remarks_of(named: dict[str, Figures], outcome: Outcome) -> list[str]:
    """Return what a reader must know beside the figures, in sentences."""
    sentences = list(outcome.source.remarks)
    unscored = dict.fromkeys(t for each in named.values() for t in each['unscored_terms'])
    if unscored:
        sentences.append(
            f'terms that mean no label, not scored by themselves: {", ".join(unscored)}'
        )
    if outcome.skipped:
        sentences.append(f'{len(outcome.skipped)} skipped, not scored:')
        sentences += [f'  {each.name}: {each.reason}' for each in outcome.skipped[:_SHOWN]]
        if len(outcome.skipped) > _SHOWN:
            sentences.append(f'  and {len(outcome.skipped) - _SHOWN} more, see --json or --html')
    return sentences
