# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Heatmaps, decisions and set-points of the small bag, against those of an earlier version.

``small_digest.npz`` was written by version 3523282, then again when clearance began to count to the
nearest corner of the obstacle (a site is found 0.5 s later), and when the safe altitude began to
count from the lowest believed height (two steps of 231 change state one step earlier). No heatmap
changed.

The networks' sums differ a little between processors. Where the checksums of all heatmaps are
those of the stored version, decisions and set-points must be equal too; elsewhere heatmaps and
states are compared with a tolerance.
``python test_digest.py FILE`` writes what this version gives.
"""

from __future__ import annotations

import re
import sys
from pathlib import Path
from types import SimpleNamespace
from zlib import crc32

import cv2
import numpy as np
import pytest

from peace_ros.core.landing.drift import Drift
from peace_ros.lab.replay import run
from peace_ros.lab.replay.line import Step
from peace_ros.lab.replay.source import open_source
from peace_ros.lab.replay.source_options import SourceOptions

DATA = Path(__file__).resolve().parents[2] / 'data'
STORED = DATA / 'small_digest.npz'
SIDE = 44
"""Heatmaps are stored as SIDE x SIDE means."""


def replayed() -> tuple[list, list]:
    """Return the looks and the decisions of a replay of the small bag."""
    replayer = run.Replayer(open_source(DATA / 'small.mcap', SourceOptions()), 'peace_cs')
    events = list(replayer.events())
    return (
        [each for each in events if not isinstance(each, Step)],
        [each for each in events if isinstance(each, Step)],
    )


def digest_of_looks(looks: list) -> dict[str, np.ndarray]:
    levels = [np.rint(255.0 * look.heatmap.safety).astype(np.uint8) for look in looks]
    small = [cv2.resize(each, (SIDE, SIDE), interpolation=cv2.INTER_AREA) for each in levels]
    return {
        'stamps_ns': np.array([look.heatmap.stamp_ns for look in looks]),
        'prompts': np.array([look.prompt.template for look in looks]),
        'heatmaps': np.stack(small),
        'checksums': np.array([crc32(each.tobytes()) for each in levels], np.uint32),
    }


def digest_of_steps(steps: list) -> dict[str, np.ndarray]:
    """Reasons are numbered by first appearance: their wording may be improved."""
    numbers: dict[str, int] = {}
    reasons, sites, setpoints = [], [], []
    for step in steps:
        decision = step.decision
        kind = re.sub(r'[-\d.]+', '#', decision.reason)
        reasons.append(numbers.setdefault(kind, len(numbers)))
        site, setpoint = decision.site, decision.setpoint
        sites.append(
            [np.nan] * 4
            if site is None
            else [site.north_m, site.east_m, site.clearance_m, site.area_m2]
        )
        setpoints.append([setpoint.v_north_m_s, setpoint.v_east_m_s, setpoint.v_down_m_s])
    return {
        'states': np.array([step.decision.state.value for step in steps]),
        'reasons': np.array(reasons),
        'sites': np.array(sites),
        'setpoints': np.array(setpoints),
        'setpoint_stamps_ns': np.array([step.decision.setpoint.stamp_ns for step in steps]),
    }


def digest() -> dict[str, np.ndarray]:
    looks, steps = replayed()
    return {**digest_of_looks(looks), **digest_of_steps(steps)}


@pytest.fixture(scope='module')
def stored() -> SimpleNamespace:
    with np.load(STORED) as arrays:
        return SimpleNamespace(**{name: arrays[name] for name in arrays.files})


@pytest.fixture(scope='module')
def found() -> SimpleNamespace:
    """What this version gives, without the compensation of a biased velocity, which is newer.

    A recorded vehicle does not obey, which that would take for a bias.
    """
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Drift, 'made_up', lambda _drift, wish, _limit_m_s: wish)
        return SimpleNamespace(**digest())


def test_heatmaps_and_prompts_are_those_of_the_stored_version(found, stored) -> None:
    np.testing.assert_array_equal(found.stamps_ns, stored.stamps_ns)
    assert np.mean(found.prompts == stored.prompts) >= 0.95
    apart = np.abs(found.heatmaps.astype(int) - stored.heatmaps.astype(int))
    assert stored.heatmaps.std() > 30.0, 'nearly the same everywhere: this would prove nothing'
    assert apart.mean() <= 0.5
    assert np.mean(apart > 3) <= 0.005
    if found.checksums[0] == stored.checksums[0]:
        # This processor sums as the one did that wrote the file, so all must be the same.
        np.testing.assert_array_equal(found.checksums, stored.checksums)


def test_decisions_and_setpoints_are_those_of_the_stored_version(found, stored) -> None:
    assert len(set(stored.states)) >= 4, 'too few states: this would prove nothing'
    if found.checksums.tolist() != stored.checksums.tolist():
        assert np.mean(found.states == stored.states) >= 0.9
        return
    np.testing.assert_array_equal(found.states, stored.states)
    np.testing.assert_array_equal(found.reasons, stored.reasons)
    np.testing.assert_array_equal(found.setpoint_stamps_ns, stored.setpoint_stamps_ns)
    np.testing.assert_allclose(found.sites, stored.sites, atol=1e-6)
    np.testing.assert_allclose(found.setpoints, stored.setpoints, atol=1e-6)


if __name__ == '__main__':
    Drift.made_up = lambda _drift, wish, _limit_m_s: wish
    np.savez_compressed(sys.argv[1], **digest())
