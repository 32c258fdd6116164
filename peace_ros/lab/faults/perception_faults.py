# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Faults of camera, prompt and model."""

from __future__ import annotations

from dataclasses import replace

from peace_ros.core.landing import State
from peace_ros.lab.faults import tamper
from peace_ros.lab.faults.fault import (
    GOING,
    LOOKING_AGAIN,
    UNDER_WAY,
    Expected,
    Fault,
    FlightSetting,
    Injection,
)
from peace_ros.lab.faults.injections import (
    BadBundle,
    BadModel,
    Killed,
    always,
    camera,
    prompt,
)

_HOLD = State.HOLD.value
_HANDOVER = State.HANDOVER.value

NO_NEW_HEATMAP = Expected(
    reaches=(_HOLD,),
    within_s=2.5,
    still_within_s=3.5,
    zero_within_s=2.8,
    recovers=UNDER_WAY,
    recovers_within_s=12.0,
)
"""No heatmap can be used any more: the descent ends at 1.5 s, HOLD follows at 2 s."""

UNSAFE_HEATMAPS = Expected(
    reaches=LOOKING_AGAIN,
    within_s=2.0,
    still_within_s=3.5,
    recovers=GOING,
    recovers_within_s=40.0,
)
"""Heatmaps come and call the ground unsafe: the site is lost at once."""

GOES_ON = Expected(reaches=(_HANDOVER,), within_s=45.0, allowed=GOING)
"""The landing is not disturbed."""

_UNTIL_HANDOVER_S = 46.0
_WITH_PROMPTS = FlightSetting(prompts=True)


def _camera(name: str, title: str, injection: Injection, behaviour: str) -> Fault:
    return Fault(name, 'camera', title, injection, NO_NEW_HEATMAP, behaviour)


CAMERA = (
    _camera(
        'camera_stops',
        'The camera stops.',
        camera(always(tamper.nothing)),
        'Descends no more when the newest heatmap is 1.5 s old, HOLD at 2 s; goes on when '
        'pictures come again.',
    ),
    _camera(
        'camera_freezes',
        'The driver repeats the last picture with its old stamp.',
        camera(lambda: tamper.frozen(new_stamps=False)),
        'A stamp that is not newer than the last is refused: as if the camera had stopped.',
    ),
    Fault(
        'camera_freezes_restamped',
        'camera',
        'The driver repeats the last picture with new stamps.',
        camera(lambda: tamper.frozen(new_stamps=True)),
        replace(NO_NEW_HEATMAP, within_s=2.8, still_within_s=3.8, zero_within_s=3.0),
        'A picture that does not change while the vehicle moves by 0.5 m is refused: from then on '
        'as if the camera had stopped.',
    ),
    _camera(
        'camera_black',
        'The picture is black.',
        camera(lambda: tamper.filled(0)),
        'A picture of one colour is refused with a sentence: as if the camera had stopped.',
    ),
    _camera(
        'camera_saturates',
        'The picture is white.',
        camera(lambda: tamper.filled(255)),
        'A picture of one colour is refused with a sentence: as if the camera had stopped.',
    ),
    Fault(
        'camera_noise',
        'camera',
        'Every pixel is chance.',
        camera(tamper.noisy),
        UNSAFE_HEATMAPS,
        'Noise is nothing safe: the site is lost; no descent.',
    ),
    _camera(
        'camera_cut_short',
        'Half of the bytes of each picture are missing.',
        camera(always(tamper.cut_short)),
        'The picture is refused with a sentence: as if the camera had stopped.',
    ),
    _camera(
        'camera_encoding',
        'The pictures claim an encoding that does not exist.',
        camera(lambda: tamper.of_encoding('rgb99')),
        'The picture is refused with a sentence: as if the camera had stopped.',
    ),
    Fault(
        'camera_half_size',
        'camera',
        'The pictures shrink to half of their size, with the same field of view.',
        camera(lambda: tamper.resized(176, 176)),
        GOES_ON,
        'The field of view is what counts: goes on.',
        lasts_s=_UNTIL_HANDOVER_S,
        until_reached=True,
    ),
    Fault(
        'camera_other_shape',
        'camera',
        'The pictures jump to another shape, 352 x 176, cut out of the middle.',
        camera(lambda: tamper.resized(352, 176)),
        NO_NEW_HEATMAP,
        'A picture of another shape than that of the camera cannot be projected and is refused.',
    ),
    _camera(
        'stamp_future',
        'Stamps lie 10 s in the future.',
        camera(lambda: tamper.shifted(10.0)),
        'Stamps ahead of the clock are refused: as if the camera had stopped.',
    ),
    _camera(
        'stamp_past',
        'Stamps lie 5 s in the past.',
        camera(lambda: tamper.shifted(-5.0)),
        'Stamps older than the last are refused: as if the camera had stopped.',
    ),
    _camera(
        'stamp_backwards',
        'Stamps run backwards.',
        camera(tamper.running_back),
        'Stamps older than the last are refused: as if the camera had stopped.',
    ),
    _camera(
        'stamp_equal',
        'All stamps are equal.',
        camera(tamper.equal_stamps),
        'A stamp that is not newer than the last is refused: as if the camera had stopped.',
    ),
    _camera(
        'stamp_zero',
        'The driver forgets its stamps: all are zero.',
        camera(lambda: tamper.shifted(-4e9)),
        'Stamps older than the last are refused: as if the camera had stopped.',
    ),
    _camera(
        'camera_late',
        'Pictures come 3 s after they were taken.',
        camera(lambda: tamper.late(3.0)),
        'Each heatmap is too old when it comes: HOLD.',
    ),
)

PROMPT = (
    Fault(
        'prompt_missing',
        'prompt',
        'The prompt generator is killed.',
        Killed('prompt_generator'),
        GOES_ON,
        'One frame waits 0.3 s for its prompt in vain, later ones not at all; the last prompt is '
        'used, and said to be old: goes on.',
        lasts_s=_UNTIL_HANDOVER_S,
        until_reached=True,
        setting=_WITH_PROMPTS,
    ),
    Fault(
        'prompt_late',
        'prompt',
        'Prompts come 3 s late.',
        prompt(lambda: tamper.late(3.0)),
        GOES_ON,
        'One frame waits 0.3 s for its prompt in vain, later ones not at all as long as none is in '
        'time; the newest prompt is used: goes on.',
        lasts_s=_UNTIL_HANDOVER_S,
        until_reached=True,
        setting=_WITH_PROMPTS,
    ),
    Fault(
        'prompt_without_term',
        'prompt',
        'Prompts have no place for the term.',
        prompt(always(tamper.without_term)),
        GOES_ON,
        'The prompt is refused with a sentence and the last good one is used: goes on.',
        lasts_s=_UNTIL_HANDOVER_S,
        until_reached=True,
        setting=_WITH_PROMPTS,
    ),
)

MODEL = (
    Fault(
        'model_slow',
        'model',
        'The model takes 3.3 s for a frame (0.3 Hz).',
        BadModel('slow 3.3'),
        Expected(
            reaches=(_HOLD,),
            within_s=2.5,
            still_within_s=3.5,
            zero_within_s=2.8,
            recovers=UNDER_WAY,
            recovers_within_s=15.0,
        ),
        'HOLD whenever the newest heatmap is older than 2 s; never descends on such a map.',
        lasts_s=12.0,
    ),
    Fault(
        'model_throws',
        'model',
        'The network gives an error for each frame.',
        BadModel('throws'),
        NO_NEW_HEATMAP,
        'The node says so and goes on with the next frame; without heatmaps HOLD.',
    ),
    Fault(
        'model_breaks',
        'model',
        'A defect ends the segmentation node; it is started again.',
        BadModel('breaks', revive=True),
        Expected(
            reaches=(_HOLD,),
            within_s=2.5,
            still_within_s=3.5,
            zero_within_s=2.8,
            recovers=UNDER_WAY,
            recovers_within_s=25.0,
            ends_processes=('segmentation',),
        ),
        'The node ends with a traceback instead of going on silently; HOLD until it is back.',
    ),
    Fault(
        'model_nan',
        'model',
        'The segmentation is started again with weights that are no numbers.',
        BadBundle(honest=True),
        Expected(
            reaches=(_HOLD,),
            within_s=2.5,
            still_within_s=3.5,
            zero_within_s=2.8,
            recovers=UNDER_WAY,
            recovers_within_s=25.0,
        ),
        'Scores that are no numbers are refused: no heatmap, HOLD.',
        lasts_s=10.0,
    ),
    Fault(
        'bundle_damaged',
        'model',
        'The segmentation is started again with a bundle whose checksum is wrong.',
        BadBundle(honest=False),
        Expected(
            reaches=(_HOLD,),
            within_s=2.5,
            still_within_s=3.5,
            recovers=UNDER_WAY,
            recovers_within_s=25.0,
            ends_processes=('segmentation',),
        ),
        'The node refuses to start and names the file; HOLD.',
        lasts_s=10.0,
    ),
)

FAULTS = (*CAMERA, *PROMPT, *MODEL)
"""In the order of the documentation."""
