# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Figures for a terminal."""

from __future__ import annotations

from typing import Any

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


def with_interval(value: float | None, interval: list[float] | None) -> str:
    """Return a share in per cent with its interval."""
    if value is None or interval is None:
        return percent(value)
    return f'{percent(value)} ({percent(interval[0])} to {percent(interval[1])})'


def figures_table(named: dict[str, Figures]) -> Table:
    """Return a table with a column for each configuration; in per cent unless said."""
    full = len(named) <= _FULL
    title = 'per cent, with 95 % intervals over frames' if full else 'per cent'
    table = Table(title=title, title_justify='left')
    table.add_column('')
    for name in named:
        table.add_column(name, justify='right', no_wrap=True)
    for key, title in ROWS:
        table.add_row(title, *(_cell(each, key, full=full) for each in named.values()))
    table.add_section()
    for hazard in HAZARDS:
        cells = [_part(each, 'false_safe_by_hazard', hazard, full=full) for each in named.values()]
        table.add_row(f'{hazard} called safe', *cells)
    table.add_section()
    for term in dict.fromkeys(term for each in named.values() for term in each['iou_by_term']):
        cells = [_part(each, 'iou_by_term', term, full=full) for each in named.values()]
        table.add_row(f'IoU of "{term}"', *cells)
    table.add_section()
    table.add_row('threshold (score)', *(f'{each["threshold"]:.3f}' for each in named.values()))
    table.add_row('frames (tiles)', *(f'{e["frames"]} ({e["tiles"]})' for e in named.values()))
    table.add_row('tiles per second', *(_rate(each) for each in named.values()))
    return table


def _cell(figures: Figures, key: str, *, full: bool) -> str:
    return with_interval(figures[key], figures[f'{key}_interval'] if full else None)


def _part(figures: Figures, key: str, part: str, *, full: bool) -> str:
    values: dict[str, Any] = figures[key]
    interval = figures[f'{key}_interval'].get(part) if full else None
    return with_interval(values.get(part), interval)


def _rate(figures: Figures) -> str:
    return '-' if figures['hz'] is None else f'{figures["hz"]:.1f}'


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
