# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The figures of an experiment: rates and means with intervals, and paired tests."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from itertools import combinations
from typing import Any

import numpy as np
from scipy import stats

from peace_ros.lab.experiment.store import Row

CONFIDENCE = 0.95
_RESAMPLES = 2000
Interval = tuple[float, float]
Figures = dict[str, Any]


def figures(rows: Sequence[Row]) -> Figures:
    """Return the figures of an experiment.

    Args:
        rows: of its file.

    Returns:
        `groups`: a dictionary for each configuration and policy; `paired`: comparisons of each two
        of them over the runs that both have flown.
    """
    groups: dict[tuple[str, str], list[Row]] = {}
    for row in rows:
        groups.setdefault((row['configuration'], row['policy']), []).append(row)
    return {
        'groups': [_group(*name, of_group) for name, of_group in groups.items()],
        'paired': [
            _paired(first, second, groups[first], groups[second])
            for first, second in combinations(groups, 2)
        ],
    }


def wilson(count: int, total: int) -> Interval | None:
    """Return the Wilson interval of a rate; None of nothing."""
    if total == 0:
        return None
    interval = stats.binomtest(count, total).proportion_ci(CONFIDENCE, method='wilson')
    return float(interval.low), float(interval.high)


def bootstrap_mean(values: Sequence[float]) -> Interval | None:
    """Return the bootstrap interval of a mean (percentiles); None of less than two values."""
    if len(values) < 2:
        return None
    result = stats.bootstrap(
        (np.asarray(values),),
        np.mean,
        confidence_level=CONFIDENCE,
        n_resamples=_RESAMPLES,
        method='percentile',
        rng=np.random.default_rng(1),
    )
    return float(result.confidence_interval.low), float(result.confidence_interval.high)


def _group(configuration: str, policy: str, rows: list[Row]) -> Figures:
    results = Counter(row['result'] for row in rows)
    rights = Counter(row['no_zone_right'] for row in rows if row['result'] == 'no_zone')
    landed = [row for row in rows if row['result'] in {'safe', 'unsafe', 'unknown'}]
    simulated_s = sum(row['time_s'] for row in rows)
    told: Figures = {'configuration': configuration, 'policy': policy, 'runs': len(rows)}
    for result in ('safe', 'unsafe', 'no_zone', 'timeout', 'unknown', 'failed'):
        told[result] = results[result]
        told[f'{result}_interval'] = wilson(results[result], len(rows))
    told['no_zone_right'] = rights[True]
    told['no_zone_right_interval'] = wilson(rights[True], results['no_zone'])
    told['unsafe_by_hazard'] = dict(Counter(row['hazard'] for row in rows if row['hazard']))
    for name, of_rows in (
        ('time_s', rows),
        ('horizontal_distance_m', landed),
        ('clearance_m', landed),
        ('nearest_person_m', rows),
        ('miou', rows),
        ('attempts', rows),
    ):
        values = [float(row[name]) for row in of_rows if row[name] is not None]
        told[f'{name}_mean'] = float(np.mean(values)) if values else None
        told[f'{name}_mean_interval'] = bootstrap_mean(values)
    persons_m = [row['nearest_person_m'] for row in rows if row['nearest_person_m'] is not None]
    told['nearest_person_m_least'] = min(persons_m, default=None)
    told['heatmap_hz'] = sum(row['heatmaps'] for row in rows) / simulated_s if simulated_s else None
    told['state_s_mean'] = _mean_states(rows)
    told['realtime_factor'] = simulated_s / max(sum(row['wall_s'] for row in rows), 1e-9)
    told['simulated_s_per_core_s'] = simulated_s / max(sum(row['core_s'] for row in rows), 1e-9)
    return told


def _mean_states(rows: list[Row]) -> dict[str, float]:
    total: Counter[str] = Counter()
    for row in rows:
        for name, seconds in row['state_s']:
            total[name] += seconds
    return {name: seconds / len(rows) for name, seconds in total.items()}


def _paired(
    first: tuple[str, str], second: tuple[str, str], rows: list[Row], others: list[Row]
) -> Figures:
    """Compare two groups over the runs that both have flown."""
    by_run = {row['run']: row for row in others}
    pairs = [(row, by_run[row['run']]) for row in rows if row['run'] in by_run]
    only = [
        sum(a['result'] == 'safe' and b['result'] != 'safe' for a, b in each)
        for each in (pairs, [(b, a) for a, b in pairs])
    ]
    slower_s = np.array([a['time_s'] - b['time_s'] for a, b in pairs])
    return {
        'first': '/'.join(first),
        'second': '/'.join(second),
        'runs': len(pairs),
        'safe_only_first': only[0],
        'safe_only_second': only[1],
        # McNemar's exact test: a binomial test over the runs that differ.
        'safe_p': float(stats.binomtest(only[0], sum(only)).pvalue) if sum(only) else 1.0,
        'time_s_difference': float(slower_s.mean()) if pairs else None,
        'time_s_p': float(stats.wilcoxon(slower_s).pvalue) if slower_s.any() else 1.0,
    }
