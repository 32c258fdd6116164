# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Faults of heatmaps, and of the world below."""

from __future__ import annotations

from dataclasses import replace

from peace_ros.core.landing import State
from peace_ros.lab.faults import tamper
from peace_ros.lab.faults.fault import (
    LOOKING_AGAIN,
    UNDER_WAY,
    Expected,
    Fault,
    FlightSetting,
    Moment,
)
from peace_ros.lab.faults.injections import (
    Person,
    always,
    camera,
    every_s,
    heatmap,
)
from peace_ros.lab.faults.perception_faults import NO_NEW_HEATMAP, UNSAFE_HEATMAPS

_HOLD = State.HOLD.value
_HANDOVER = State.HANDOVER.value
_STOPS = (_HOLD, *LOOKING_AGAIN)
"""The descent ends, whether the landing calls it missing data or a lost site."""

HEATMAP = (
    Fault(
        'heatmap_stops',
        'heatmap',
        'Heatmaps get lost on the way to the landing node.',
        heatmap(always(tamper.nothing)),
        NO_NEW_HEATMAP,
        'As if the camera had stopped.',
    ),
    Fault(
        'heatmap_rare',
        'heatmap',
        'One heatmap comes every 3.3 s.',
        heatmap(every_s(3.3)),
        Expected(
            reaches=(_HOLD,),
            within_s=2.8,
            still_within_s=3.6,
            zero_within_s=3.0,
            recovers=UNDER_WAY,
            recovers_within_s=15.0,
        ),
        'HOLD whenever the newest one is older than 2 s; never descends on such a map.',
        lasts_s=10.0,
    ),
    Fault(
        'heatmap_all_safe',
        'heatmap',
        'Every pixel is called surely safe, over safe ground.',
        heatmap(lambda: tamper.filled(255)),
        NO_NEW_HEATMAP,
        'A heatmap without any contrast is not believed: as if the camera had stopped.',
        lasts_s=8.0,
    ),
    Fault(
        'heatmap_all_safe_over_roofs',
        'heatmap',
        'Every pixel is called surely safe, over buildings, while a site is sought.',
        heatmap(lambda: tamper.filled(255)),
        Expected(
            reaches=(_HOLD,),
            within_s=2.8,
            allowed=(State.SEARCHING.value, _HOLD),
            still_within_s=1.0,
        ),
        'A heatmap without any contrast is not believed: no site is chosen on it.',
        at=Moment(State.SEARCHING.value),
        lasts_s=20.0,
        setting=FlightSetting(world='roofs'),
    ),
    Fault(
        'heatmap_all_unsafe',
        'heatmap',
        'Every pixel is called unsafe.',
        heatmap(lambda: tamper.filled(0)),
        UNSAFE_HEATMAPS,
        'The site is lost: WAITING, then CLIMBING to look for another.',
        lasts_s=8.0,
    ),
    Fault(
        'heatmap_flickers',
        'heatmap',
        'Heatmaps are all safe and all unsafe in turn.',
        heatmap(tamper.flickering),
        UNSAFE_HEATMAPS,
        'Unsafe is believed sooner and remembered longer than safe: the site is lost.',
        lasts_s=8.0,
    ),
    Fault(
        'heatmap_encoding',
        'heatmap',
        'Heatmaps come in another encoding.',
        heatmap(lambda: tamper.of_encoding('rgb8')),
        NO_NEW_HEATMAP,
        'They are refused with a sentence: as if the camera had stopped.',
    ),
    Fault(
        'heatmap_cut_short',
        'heatmap',
        'Half of the bytes of each heatmap are missing.',
        heatmap(always(tamper.cut_short)),
        NO_NEW_HEATMAP,
        'They are refused with a sentence: as if the camera had stopped.',
    ),
    Fault(
        'heatmap_late',
        'heatmap',
        'Heatmaps come 3 s late.',
        heatmap(lambda: tamper.late(3.0)),
        NO_NEW_HEATMAP,
        'Each is too old when it comes: HOLD.',
    ),
)

_PERSON = Expected(reaches=(_HANDOVER, *_STOPS), within_s=24.0)
"""A hand-over within the safety radius of the person is unsafe, as any fault judges it."""

WORLD = (
    Fault(
        'person_seen_at_30_m',
        'world',
        'At 30 m a person walks to the place below and stays; the model sees them.',
        Person(seen=True),
        replace(_PERSON, over_person_s=1.5),
        'The ground is closed at once: the site moves away from the person, or is lost; never a '
        'hand-over above them.',
        at=Moment(below_m=30.0),
        lasts_s=25.0,
        note='The heatmap around the person is darkened, whatever the model sees.',
    ),
    Fault(
        'person_painted_at_30_m',
        'world',
        'At 30 m a person walks to the place below and stays, painted into the picture.',
        Person(seen=False),
        _PERSON,
        'As before, as far as the model sees a person of four pixels (at 30 m).',
        at=Moment(below_m=30.0),
        lasts_s=25.0,
    ),
    Fault(
        'every_site_occupied',
        'world',
        'A car stands every few metres on all open ground.',
        camera(always(tamper.untouched)),
        Expected(
            reaches=LOOKING_AGAIN,
            within_s=1.0,
            allowed=(*LOOKING_AGAIN, _HOLD, State.AIMING.value),
            still_within_s=1.0,
        ),
        'There is no safe place: it searches on and does not descend.',
        at=Moment(State.SEARCHING.value),
        lasts_s=25.0,
        setting=FlightSetting(world='crowded'),
    ),
)

FAULTS = (*HEATMAP, *WORLD)
"""In the order of the documentation."""
