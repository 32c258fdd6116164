# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A replay compared with a stored one: the same answers, within stated tolerances.

The sums of the networks differ in their last bits between processors, which add in another order.
So a pixel at the threshold, or one of two words that fit equally well, may change sides; a state
then begins a few decisions earlier or later, and one of two places that are equally good is
chosen. The tolerances allow for that and for no more; docs/replay.md has what was measured.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from peace_ros.lab.export.agreement import mask_iou
from peace_ros.lab.replay.trace import Trace

LEAST_IOU = 0.9
"""Of what is called safe in a frame, and of what is not."""
BORDER_SHARE = 0.005
"""Pixels of a frame that may differ whatever the IoU, which says little of a few pixels."""
MOST_OTHER_PROMPTS = 0.05
"""Share of the frames whose words may differ."""
SLACK_STEPS = 5
"""A decision is compared with those of the golden replay up to half a second from it."""
NEAR_M, NEAR_M_S = 3.0, 0.3
"""How far a site may be off, and a component of a set-point."""
MOST_OTHER_STEPS = 0.05
"""Share of the decisions whose site or set-point may be off."""
MOST_FEWER_USED = 0.05
"""Share of the heatmaps of the golden replay that may miss the map."""

_Near = Callable[[NDArray[Any], NDArray[Any]], NDArray[np.bool_]]


@dataclass(frozen=True)
class Check:
    """One kind of answer, compared."""

    name: str
    found: str
    """What was found, as a sentence."""
    tolerance: str
    passed: bool
    first_ns: int | None = None
    """Stamp of the first difference beyond the tolerance, where it has one."""


def compare(found: Trace, golden: Trace) -> list[Check]:
    """Compare a replay with the golden one, kind by kind."""
    _, mine, theirs = np.intersect1d(
        found.frame_stamps_ns, golden.frame_stamps_ns, assume_unique=True, return_indices=True
    )
    same_words = np.array(
        [found.prompts[a] == golden.prompts[b] for a, b in zip(mine, theirs, strict=True)], bool
    )
    return [
        _engagement(found),
        _frames(found, golden),
        _used(found, golden),
        _prompts(found, golden, mine, theirs, same_words),
        _heatmaps(found, golden, mine[same_words], theirs[same_words]),
        *_decisions(found, golden),
    ]


def first_difference_ns(checks: list[Check]) -> int | None:
    """Return the stamp of the first difference beyond the tolerances."""
    stamps = [each.first_ns for each in checks if not each.passed and each.first_ns is not None]
    return min(stamps, default=None)


def _engagement(found: Trace) -> Check:
    states = ', '.join(found.distinct_states)
    return Check(
        'engagement',
        f'{found.used} heatmaps reached the map, states {states}'
        if found.was_engaged
        else 'nothing was engaged: no heatmap reached the map of the landing core',
        'at least one heatmap reaches the map in a state other than IDLE',
        found.was_engaged,
    )


def _frames(found: Trace, golden: Trace) -> Check:
    lost = np.setdiff1d(golden.frame_stamps_ns, found.frame_stamps_ns)
    extra = np.setdiff1d(found.frame_stamps_ns, golden.frame_stamps_ns)
    other = np.concatenate((lost, extra))
    return Check(
        'frames',
        f'{len(found.frame_stamps_ns)} frames with a heatmap; {len(lost)} of '
        f'{len(golden.frame_stamps_ns)} are missing, {len(extra)} are new',
        'the same frames',
        not len(other),
        int(other.min()) if len(other) else None,
    )


def _used(found: Trace, golden: Trace) -> Check:
    return Check(
        'frames used',
        f'{found.used} heatmaps reached the map, {golden.used} did before',
        f'at most {MOST_FEWER_USED:.0%} fewer',
        found.used >= (1.0 - MOST_FEWER_USED) * golden.used,
    )


def _prompts(
    found: Trace,
    golden: Trace,
    mine: NDArray[Any],
    theirs: NDArray[Any],
    same: NDArray[np.bool_],
) -> Check:
    other = np.flatnonzero(~same)
    passed = len(other) <= MOST_OTHER_PROMPTS * max(1, len(same))
    told = f'{len(other)} of {len(same)} differ'
    if len(other):
        first = other[0]
        told += f', first {found.prompts[mine[first]]!r} for {golden.prompts[theirs[first]]!r}'
    first_ns = None if passed else int(found.frame_stamps_ns[mine[other[0]]])
    return Check(
        'prompts', told, f'at most {MOST_OTHER_PROMPTS:.0%} of the frames', passed, first_ns
    )


def _heatmaps(found: Trace, golden: Trace, mine: NDArray[Any], theirs: NDArray[Any]) -> Check:
    tolerance = (
        f'IoU of safe and of unsafe ground at least {LEAST_IOU:g} in each frame with the same '
        f'prompt, or at most {BORDER_SHARE:.1%} of its pixels differ'
    )
    if found.mask_shape != golden.mask_shape:
        sizes = ['{1} x {0}'.format(*each.mask_shape) for each in (found, golden)]
        stamp = int(found.frame_stamps_ns[0]) if len(mine) else None
        told = f'of {sizes[0]} in place of {sizes[1]} px: another model made them'
        return Check('heatmaps', told, tolerance, passed=False, first_ns=stamp)
    apart, least = [], 1.0
    for a, b in zip(mine, theirs, strict=True):
        one, other = found.safe(a), golden.safe(b)
        iou = min(mask_iou(one, other), mask_iou(~one, ~other))
        is_border = np.count_nonzero(one ^ other) <= BORDER_SHARE * one.size
        least = min(least, iou)
        if iou < LEAST_IOU and not is_border:
            apart.append(int(found.frame_stamps_ns[a]))
    told = f'{len(apart)} of {len(mine)} differ, least IoU {least:.4f}'
    return Check('heatmaps', told, tolerance, not apart, apart[0] if apart else None)


def _decisions(found: Trace, golden: Trace) -> list[Check]:
    stamps, mine, theirs = np.intersect1d(
        found.step_stamps_ns, golden.step_stamps_ns, assume_unique=True, return_indices=True
    )

    def differing(a: Any, b: Any, near: _Near) -> NDArray[Any]:
        return np.flatnonzero(_apart(np.asarray(a)[mine], np.asarray(b)[theirs], near))

    def check(name: str, told: str, tolerance: str, other: NDArray[Any], most: float) -> Check:
        passed = bool(len(stamps)) and len(other) <= most * len(stamps)
        first_ns = int(stamps[other[0]]) if len(other) and not passed else None
        counted = f'{len(other)} of {len(stamps)} decisions differ{told}'
        return Check(name, counted, tolerance, passed, first_ns)

    states = differing(found.states, golden.states, np.equal)
    sites = differing(found.sites_m, golden.sites_m, _near(NEAR_M))
    setpoints = differing(found.setpoints_m_s, golden.setpoints_m_s, _near(NEAR_M_S))
    moment = f'within {SLACK_STEPS * 0.1:g} s'
    told = ''
    if len(states):
        told = f': {", ".join(found.distinct_states)} for {", ".join(golden.distinct_states)}'
    most = f'in at least {1.0 - MOST_OTHER_STEPS:.0%} of the decisions'
    return [
        check('states', told, f'the same {moment}', states, 0.0),
        check('sites', '', f'{NEAR_M:g} m {moment}, {most}', sites, MOST_OTHER_STEPS),
        check('set-points', '', f'{NEAR_M_S:g} m/s {moment}, {most}', setpoints, MOST_OTHER_STEPS),
    ]


def _near(limit: float) -> _Near:
    """Return what tells of rows whether no component is further off; NaN is only near NaN."""

    def near(one: NDArray[Any], other: NDArray[Any]) -> NDArray[np.bool_]:
        close = np.isclose(one, other, rtol=0.0, atol=limit, equal_nan=True)
        return np.asarray(close.all(axis=-1), np.bool_)

    return near


def _apart(one: NDArray[Any], other: NDArray[Any], near: _Near) -> NDArray[np.bool_]:
    """Return which elements of each have nothing near in the other, close to their own moment."""
    count = len(one)
    met_one, met_other = np.zeros(count, bool), np.zeros(count, bool)
    reach = min(SLACK_STEPS, count - 1)
    for shift in range(-reach, reach + 1):
        here = slice(max(0, -shift), count - max(0, shift))
        there = slice(max(0, shift), count + min(0, shift))
        is_near = near(one[here], other[there])
        met_one[here] |= is_near
        met_other[there] |= is_near
    return ~(met_one & met_other)
