# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What a run of the matrix came to: figures, a table for the terminal, JSON for machines."""

from __future__ import annotations

import json
import os
import platform
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from rich.table import Table

from peace_ros import __version__
from peace_ros.core.domain import RecordingError
from peace_ros.lab.faults.run import Results, Row
from peace_ros.recording.run_folder import write_whole

_TAKE_OVERS = 'pilot_'
_DEAD_MAN = 'executor_stalls'


def figures(results: Results, duration_s: float) -> dict[str, Any]:
    """Return everything that ``--json`` writes."""
    rows = results.rows
    return {
        'version': __version__,
        'machine': {'processor': platform.machine(), 'cores': os.cpu_count()},
        'duration_s': round(duration_s, 1),
        'faults': len(rows),
        'passed': sum(bool(row['passed']) for row in rows),
        'unsafe_handovers': sum(int(row['unsafe_handovers']) for row in rows),
        'crashes': sum(int(row['crashes']) for row in rows),
        'hangs': sum(int(row['hangs']) for row in rows),
        'repeated': sum(row['attempts'] > 1 for row in rows),
        'too_slow': sum(bool(row['slow']) and not row['passed'] for row in rows),
        'setpoint_gap_s': gap_figures(results.gaps_s),
        'reaction_to_pilot_s': _worst(rows, _TAKE_OVERS, 'last_setpoint_s'),
        'dead_man_s': _worst(rows, _DEAD_MAN, 'last_motion_s'),
        'rows': rows,
    }


def gap_figures(gaps_s: Sequence[float]) -> dict[str, float]:
    """Return p50, p99 and the longest gap between set-points on the wire, and their number."""
    if not gaps_s:
        return {'count': 0}
    p50, p99 = np.percentile(gaps_s, (50, 99))
    return {
        'count': len(gaps_s),
        'p50': round(float(p50), 4),
        'p99': round(float(p99), 4),
        'max': round(max(gaps_s), 4),
    }


def _worst(rows: Sequence[Row], prefix: str, key: str) -> float | None:
    """Return the latest of a figure among the rows of a name; None when it was not measured."""
    found = [row for row in rows if row['name'].startswith(prefix)]
    # Nothing on the wire after the injection is the quickest reaction there is.
    return max((float(row['figures'].get(key, 0.0)) for row in found), default=None)


def write(told: dict[str, Any], path: Path) -> None:
    """Write the JSON.

    Raises:
        RecordingError: the file cannot be written.
    """
    try:
        write_whole(path, json.dumps(told, indent=2) + '\n', 'report')
    except OSError as error:
        raise RecordingError(
            f'report {path} cannot be written ({error}): give a file in a writable folder'
        ) from error


def line(row: Row) -> str:
    """Return one row as a line."""
    took = '' if row['took_s'] is None else f' after {row["took_s"]:.1f} s'
    word = 'passed' if row['passed'] else 'FAILED'
    states = ' > '.join(row['states'][-6:])
    told = [f'{word}  {row["name"]}{took}: {states}', *row['failures']]
    if row['attempts'] > 1:
        told.append(f'{row["attempts"]} flights')
    if row['slow'] and (row['attempts'] > 1 or not row['passed']):
        told.append(f'no fair test, the machine was too slow: {row["slow"]}')
    return '\n        '.join(told)


def table(told: dict[str, Any]) -> Table:
    """Return the figures for the terminal."""
    grid = Table.grid(padding=(0, 2))
    grid.add_column(style='dim')
    grid.add_column()
    gaps = told['setpoint_gap_s']
    grid.add_row('faults', f'{told["passed"]} of {told["faults"]} as documented')
    for key in ('unsafe_handovers', 'crashes', 'hangs', 'repeated', 'too_slow'):
        grid.add_row(key.replace('_', ' '), str(told[key]))
    if gaps['count']:
        grid.add_row(
            'set-point gap',
            f'p50 {gaps["p50"] * 1e3:.0f} ms, p99 {gaps["p99"] * 1e3:.0f} ms, '
            f'max {gaps["max"] * 1e3:.0f} ms ({gaps["count"]} on the wire)',
        )
    for key, name in (
        ('reaction_to_pilot_s', 'last set-point after a take-over'),
        ('dead_man_s', 'last motion of a stalled executor'),
    ):
        if told[key] is not None:
            grid.add_row(name, f'{told[key]:.2f} s')
    grid.add_row('took', f'{told["duration_s"] / 60.0:.1f} min')
    return grid
