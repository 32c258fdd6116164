# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What ``landing/status`` says in typical moments of a landing, for the tests of the page."""

from __future__ import annotations

import time

import cv2
import numpy as np

from peace_ros.core.images import jpeg_from_rgb
from peace_ros.watch.ledger import Ledger, Picture, TaskReport

LIMITS = {
    'safe_altitude_m': 50.0,
    'handover_altitude_m': 20.0,
    'lateral_speed_limit': 5.0,
    'landing_lateral_speed_limit': 1.5,
    'z_speed_landing': 3.0,
    'z_speed_climbing': 3.0,
    'geofence_radius_m': 0.0,
    'search_radius_m': 150.0,
}
_VEHICLE = {
    'north_m': '12.0',
    'east_m': '-4.0',
    'altitude_agl_m': '63.2',
    'v_north_m_s': '0.000',
    'v_east_m_s': '0.000',
    'v_down_m_s': '0.000',
    'time_in_state_s': '14.0',
    'map_age_s': '0.200',
    'telemetry_age_s': '0.05',
    'effective_threshold': '0.800',
    'mode': 'GUIDED',
    'armed': 'true',
    'in_control': 'true',
    'guard': '',
    'verdict': 'NO_ZONE',
    'verdict_reason': 'nothing is known yet',
}
_REFUSED = {
    'refused/1/north_m': '20.0',
    'refused/1/east_m': '2.0',
    'refused/1/clearance_m': '3.1',
    'refused/1/distance_m': '10.0',
    'refused/1/reason': 'too narrow by 1.2 m: 3.1 m of clearance, 4.3 m are needed from this '
    'altitude',
    'refused/2/north_m': '-9.0',
    'refused/2/east_m': '-18.0',
    'refused/2/clearance_m': '7.5',
    'refused/2/distance_m': '25.2',
    'refused/2/reason': 'something clearly unsafe was seen there 3 s ago',
}
_SITE = {
    'verdict': 'SITE',
    'verdict_reason': 'site with 9.3 m of clearance',
    'site_north_m': '38.0',
    'site_east_m': '16.0',
    'site_clearance_m': '9.3',
    'site_area_m2': '410',
    'site_confidence': '0.93',
    'site_age_s': '0.4',
    'focus_north_m': '36.0',
    'focus_east_m': '15.0',
    'focus_radius_m': '14.0',
}
SCENES = {
    'idle': {'state': 'IDLE', 'reason': 'not engaged', 'in_control': 'false', 'mode': 'LOITER'},
    'searching': {
        'state': 'SEARCHING',
        'reason': 'engaged: searching',
        'verdict_reason': 'the widest safe ground is too narrow by 1.2 m: 3.1 m of clearance, '
        '4.3 m are needed from this altitude',
        **_REFUSED,
    },
    'aiming': {
        'state': 'AIMING',
        'reason': 'a site is known: moving over it',
        'v_north_m_s': '2.600',
        'v_east_m_s': '2.000',
        **_SITE,
        **_REFUSED,
    },
    'landing': {
        'state': 'LANDING',
        'reason': 'over the site: descending',
        'north_m': '37.9',
        'east_m': '16.1',
        'altitude_agl_m': '41.7',
        'v_down_m_s': '0.900',
        'guard': 'no descent: the ground below was not just seen',
        **_SITE,
        **_REFUSED,
    },
    'hold': {
        'state': 'HOLD',
        'reason': 'the newest heatmap is 2.4 s old, at most 2.0 s are allowed: holding',
        'map_age_s': '2.4',
        **_SITE,
    },
    'aborted': {
        'state': 'ABORTED',
        'reason': 'aborted, engage again to continue: the mode is LOITER, not GUIDED',
        'mode': 'LOITER',
        'in_control': 'false',
        'outcome': 'aborted',
    },
    'handover': {
        'state': 'HANDOVER',
        'reason': 'handed over: hovering over a safe site',
        'altitude_agl_m': '20.1',
        'outcome': 'handover',
        **_SITE,
    },
}
LEVELS = {'hold': 1, 'aborted': 2}


def status_of(scene: str) -> dict[str, str]:
    return {**_VEHICLE, **SCENES[scene]}


def show(ledger: Ledger, scene: str) -> None:
    """Fill the ledger as the node would in that moment."""
    now_s = time.monotonic()
    ledger.hear_status(status_of(scene), LEVELS.get(scene, 0), now_s)
    with ledger.lock:
        ledger.parameters = dict(LIMITS)


def fill(ledger: Ledger) -> None:
    """Give the ledger a past, pictures, a prompt and findings."""
    now_s = time.monotonic()
    for back_s in range(240, 0, -1):
        scene = 'idle' if back_s > 200 else 'searching' if back_s > 120 else 'aiming'
        values = {**status_of(scene), 'altitude_agl_m': f'{63.2 + back_s / 6.0:.1f}'}
        values.update(north_m=f'{12.0 - back_s / 8.0}', east_m=f'{-4.0 - back_s / 20.0}')
        ledger.hear_status(values, 0, now_s - back_s)
    ledger.hear_prompt(
        {
            'template': 'a drone photo of {term} in a sunny spring suburb',
            'best/season': 'spring',
            'score/season/spring': '0.81',
            'score/season/autumn': '0.12',
            'best/weather': 'sunny',
            'score/weather/sunny': '0.67',
            'score/weather/overcast': '0.30',
        },
        1,
        now_s,
    )
    late = {'rate_hz': '0.0', 'latency_s': '0.310'}
    silent = 'no heatmap on /heatmap for 4 s: does its publisher work?'
    good = {'rate_hz': '10.0', 'latency_s': '0.021'}
    far_s = now_s + 1e6  # never silent
    ledger.hear_findings(
        [
            TaskReport('landing: heatmap', 2, silent, late, far_s),
            TaskReport('segmentation: image', 0, 'image arrives', good, far_s),
        ]
    )
    picture = np.full((352, 352, 3), (90, 120, 80), np.uint8)
    cv2.circle(picture, (176, 140), 70, (40, 220, 60), -1)
    corners = [[0.5 + 0.2 * np.cos(t), 0.4 + 0.2 * np.sin(t)] for t in np.arange(0.0, 6.2, 0.3)]
    refused = [[u - 0.3, v + 0.3] for u, v in corners]
    marks = [
        {'kind': 'refused 1', 'middle': [0.2, 0.7], 'corners': refused},
        {'kind': 'site', 'middle': [0.5, 0.4], 'corners': corners},
    ]
    ledger.overlay = Picture(1, jpeg_from_rgb(picture, 80), now_s, {'marks': marks})
