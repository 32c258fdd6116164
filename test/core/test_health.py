# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Findings about inputs and work: silence, several sources, stamps of another clock."""

from __future__ import annotations

import numpy as np
import pytest

from peace_ros.core.domain import Health, Level
from peace_ros.core.health import InputWatch, WorkHealth

NOW_NS = 1_800_000_000 * 10**9
TOPIC = '/camera/image_raw'


@pytest.fixture
def watch():
    return InputWatch('image', TOPIC, 100.0)


def test_an_input_that_never_came_is_first_a_warning_and_then_an_error(watch):
    assert watch.health(101.0, 1).level is Level.WARN
    silent = watch.health(103.0, 1)
    assert silent.level is Level.ERROR
    assert silent.sentence.startswith(f'no image on {TOPIC} for 3 s: does')
    assert 'nothing publishes it' in watch.health(104.0, 0).sentence


def test_an_input_that_has_stopped_is_an_error_until_it_comes_again(watch):
    watch.arrived(NOW_NS, NOW_NS, 101.0)
    assert watch.health(101.5, 1).level is Level.OK
    assert watch.health(104.0, 1).level is Level.ERROR
    watch.arrived(NOW_NS, NOW_NS, 105.0)
    assert watch.health(105.5, 1).level is Level.OK


def test_rate_and_latency_are_told(watch):
    for number in range(20):
        watch.arrived(NOW_NS - 50_000_000, NOW_NS, 100.0 + number / 10)
    values = dict(watch.health(102.0, 1).values)
    assert float(values['rate_hz']) == pytest.approx(10.0)
    assert float(values['latency_s']) == pytest.approx(0.05)
    assert (values['messages'], values['topic']) == ('20', TOPIC)


@pytest.mark.parametrize(
    ('stamp_ns', 'words'),
    [(0, 'behind'), (NOW_NS - 11 * 10**9, '11.0 s behind'), (NOW_NS + 2 * 10**9, '2.0 s ahead')],
)
def test_a_stamp_of_another_clock_is_an_error(watch, stamp_ns, words):
    watch.arrived(stamp_ns, NOW_NS, 101.0)
    found = watch.health(101.5, 1)
    assert found.level is Level.ERROR
    assert words in found.sentence
    assert 'use_sim_time' in found.sentence


def test_a_second_publisher_is_an_error_whatever_else_is_right(watch):
    watch.arrived(NOW_NS, NOW_NS, 101.0)
    found = watch.health(101.5, 2)
    assert found.level is Level.ERROR
    assert f'2 publishers of {TOPIC}' in found.sentence


def test_a_failure_between_two_reports_is_not_hidden_by_a_later_success():
    work = WorkHealth()
    work.put(Health(Level.ERROR, 'no'))
    work.put(Health(Level.OK, 'running'))
    assert work.take().sentence == 'no'
    assert work.take().sentence == 'running'


def lossy(watch, arrives, rate_hz=30.0, jitter_s=0.0, seconds=10.0):
    """Let those images of a camera arrive that ``arrives`` lets pass; return the finding."""
    rng = np.random.default_rng(1)
    now_s = 100.0
    for number in range(int(seconds * rate_hz)):
        now_s = 100.0 + number / rate_hz
        stamp_ns = NOW_NS + round((number / rate_hz + jitter_s * rng.standard_normal()) * 1e9)
        if arrives(rng, number):
            watch.arrived(stamp_ns, stamp_ns + 10**7, now_s)
    return watch.health(now_s, 1)


@pytest.fixture
def camera():
    return InputWatch('image', TOPIC, 100.0, periodic=True)


@pytest.mark.parametrize('part', [0.2, 0.4])
def test_images_that_are_lost_on_the_way_are_a_warning_with_both_rates(camera, part):
    found = lossy(camera, lambda rng, _number: rng.random() < part, seconds=30.0)
    assert found.level is Level.WARN
    assert 'about 30 are sent' in found.sentence
    arriving_hz = float(found.sentence.split()[0])
    assert arriving_hz == pytest.approx(30.0 * part, rel=0.25)
    assert 'config/fastdds.xml' in found.sentence


@pytest.mark.parametrize('rate_hz', [5.0, 30.0])
def test_a_camera_that_loses_little_or_is_slow_is_fine(camera, rate_hz):
    found = lossy(
        camera,
        lambda rng, _number: rng.random() < 0.9,
        rate_hz=rate_hz,
        jitter_s=0.1 / rate_hz,
        seconds=60.0,
    )
    assert found.level is Level.OK


def test_losses_are_judged_of_cameras_only_and_after_some_images(watch, camera):
    assert lossy(watch, lambda rng, _number: rng.random() < 0.2).level is Level.OK
    assert lossy(camera, lambda rng, _number: rng.random() < 0.2, seconds=3.0).level is Level.OK


def test_a_clock_that_goes_back_is_no_loss(camera):
    lossy(camera, lambda rng, _number: rng.random() < 0.2, seconds=30.0)
    assert lossy(camera, lambda _rng, _number: True).level is Level.OK
