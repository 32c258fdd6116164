# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Prompt generator and segmentation in one process."""

from __future__ import annotations

import signal
import subprocess
import sys
import time

import pytest
from diagnostic_msgs.msg import DiagnosticArray
from sensor_msgs.msg import Image

from peace_ros.core.domain import ImageError
from peace_ros.core.messages import stamp_ns_of
from peace_ros.nodes import qos
from peace_ros.nodes.sharing import SharedImages


def test_an_image_is_decoded_once_for_all_who_take_it(frame):
    images, decoded, got = SharedImages(), [], []

    def decode(message):
        decoded.append(message)
        return frame

    def take(message):
        got.append(images.frame(message))

    images.decode = decode
    images.add(take)
    images.add(lambda message: got.append(images.frame(message)))
    images.offer('first')
    assert (decoded, got) == (['first'], [frame, frame])
    images.remove(take)
    images.offer('second')
    assert decoded == ['first', 'second']
    assert len(got) == 3


def test_who_helps_gets_only_the_images_that_work_begins_on():
    images, helped = SharedImages(), []
    images.add(helped.append, when_begun=True)
    images.add(lambda _message: None)
    for message in ('first', 'second', 'third'):
        images.offer(message)
    images.begin('second')
    assert helped == ['second']
    images.remove(helped.append)
    images.begin('third')
    assert helped == ['second']


def test_an_image_that_cannot_be_decoded_is_an_error_for_each(frame):
    images = SharedImages()

    def decode(message):
        raise ImageError('no')

    images.decode = decode
    for _ in range(2):
        with pytest.raises(ImageError):
            images.frame('broken')


@pytest.fixture
def process(clip_folder, clipseg_folder, tmp_path):
    path = tmp_path / 'tiny.yaml'
    path.write_text(
        f'/**/prompt_generator:\n  ros__parameters: {{bundle: {clip_folder}}}\n'
        f'/**/segmentation:\n  ros__parameters: {{bundle: {clipseg_folder}}}\n'
    )
    arguments = ['--ros-args', '--params-file', str(path), '-r', '__ns:=/drone_1']
    running = subprocess.Popen([sys.executable, '-m', 'peace_ros.nodes.perception', *arguments])
    yield running
    running.kill()
    running.wait()


def test_one_process_makes_prompts_and_heatmaps_with_the_stamp_of_the_frame(
    bench, process, picture
):
    prompts = bench.heard(DiagnosticArray, 'drone_1/prompt', qos.RESULT)
    heatmaps = bench.heard(Image, 'drone_1/heatmap', qos.IMAGE_IN)
    found = bench.heard(DiagnosticArray, '/diagnostics', qos.RESULT)
    images = bench.offer(Image, 'drone_1/image', qos.IMAGE_OUT)
    stamps = []

    def see() -> None:
        stamps.append(bench.peer.get_clock().now().nanoseconds)
        images.publish(picture(stamps[-1]))

    bench.until(lambda: bool(prompts) and bool(heatmaps), see)
    assert {stamp_ns_of(prompts[0]), stamp_ns_of(heatmaps[0])} <= set(stamps)
    assert bench.peer.count_subscribers('drone_1/image') == 1
    ours = {'prompt_generator', 'segmentation'}
    hearing = bench.peer.get_subscriptions_info_by_topic('/drone_1/prompt')
    assert not ours & {each.node_name for each in hearing}, 'prompts need no message here'
    nodes = {'drone_1/prompt_generator: image', 'drone_1/segmentation: image'}
    bench.until(lambda: nodes <= {each.name for array in found for each in array.status}, see)
    began_s = time.monotonic()
    process.send_signal(signal.SIGINT)
    assert process.wait(timeout=10.0) == 0
    assert time.monotonic() - began_s < 4.0
