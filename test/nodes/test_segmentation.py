# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Heatmaps carry the stamp and the prompt of their frame; slowness loses frames, not time."""

from __future__ import annotations

import threading
import time
from dataclasses import replace

import numpy as np
from diagnostic_msgs.msg import DiagnosticArray
from rclpy.parameter import Parameter
from sensor_msgs.msg import CameraInfo, CompressedImage, Image

from peace_ros.core.domain import Camera, Distortion, Heatmap, Prompt
from peace_ros.core.messages import frame_from_message, heatmap_from_image, stamp_ns_of
from peace_ros.nodes import qos
from peace_ros.nodes.messages import WARN, camera_info, prompt_to_message
from peace_ros.nodes.segmentation import SegmentationNode


class Painter:
    """Notes what it is given; waits until it may answer."""

    def __init__(self, seconds: float = 0.0) -> None:
        self.seen: list[tuple[int, Prompt]] = []
        self.prepared: list[str] = []
        self.may_prepare = threading.Event()
        self.may_prepare.set()
        self.unknown_terms: dict[str, tuple[str, ...]] = {}
        self._seconds = seconds

    def prepare(self, prompt):
        self.may_prepare.wait(20.0)
        self.prepared.append(prompt.template)

    def segment(self, frame, prompt):
        time.sleep(self._seconds)
        self.seen.append((frame.stamp_ns, prompt))
        return Heatmap(np.full((6, 8), 0.8, np.float32), frame.stamp_ns)


def prompt(at_ns: int, word: str = 'winter') -> DiagnosticArray:
    return prompt_to_message(Prompt(f'A {{term}} in {word}.', at_ns))


def test_the_heatmap_carries_the_stamp_of_the_frame(bench, picture):
    heatmaps = bench.heard(Image, 'heatmap', qos.IMAGE_IN)
    bench.run(SegmentationNode, Painter(), template='DD')
    images = bench.offer(Image, 'image', qos.IMAGE_OUT)
    bench.until(lambda: bool(heatmaps), lambda: images.publish(picture(987_654_321_012)))
    heatmap = heatmap_from_image(heatmaps[0])
    assert heatmap.stamp_ns == 987_654_321_012
    assert heatmap.safety.shape == (6, 8)
    assert abs(heatmap.safety - 0.8).max() < 0.003


def test_nothing_before_the_first_prompt_then_each_frame_with_its_own(bench, picture):
    painter = Painter()
    heatmaps = bench.heard(Image, 'heatmap', qos.IMAGE_IN)
    bench.run(SegmentationNode, painter, prompt_timeout=10.0)
    images = bench.offer(Image, 'image', qos.IMAGE_OUT)
    prompts = bench.offer(DiagnosticArray, 'prompt', qos.RESULT)
    for at_ns in range(1, 6):
        images.publish(picture(at_ns))
    prompts.publish(prompt(5, 'spring'))
    bench.until(lambda: bool(painter.prepared))
    assert not painter.seen
    images.publish(picture(20))
    prompts.publish(prompt(20, 'autumn'))
    bench.until(lambda: len(heatmaps) == 1)
    assert [(at_ns, each.template) for at_ns, each in painter.seen] == [(20, 'A {term} in autumn.')]
    assert painter.seen[0][1].stamp_ns == 20


def test_says_when_it_takes_an_older_prompt(bench, picture, values_of):
    painter = Painter()
    diagnostics = bench.findings('heatmaps')
    bench.run(SegmentationNode, painter, prompt_timeout=0.05)
    images = bench.offer(Image, 'image', qos.IMAGE_OUT)
    prompts = bench.offer(DiagnosticArray, 'prompt', qos.RESULT)
    prompts.publish(prompt(1))
    bench.until(lambda: bool(painter.prepared))
    late = picture(2_500_000_001)
    bench.until(lambda: bool(diagnostics), lambda: images.publish(late))
    assert painter.seen[0][1].stamp_ns == 1
    assert '0.05 s' in diagnostics[-1].message
    assert '2.50 s before' in diagnostics[-1].message
    assert values_of(diagnostics[-1])['own_prompt'] == 'false'


def test_a_new_sentence_does_not_stall_the_frames(bench, picture):
    painter = Painter()
    bench.run(SegmentationNode, painter, prompt_timeout=0.05)
    images = bench.offer(Image, 'image', qos.IMAGE_OUT)
    prompts = bench.offer(DiagnosticArray, 'prompt', qos.RESULT)
    prompts.publish(prompt(1, 'winter'))
    bench.until(lambda: painter.prepared == ['A {term} in winter.'])
    painter.may_prepare.clear()
    prompts.publish(prompt(2, 'summer'))
    bench.until(lambda: bool(painter.seen), lambda: images.publish(picture(2)))
    assert painter.seen[0][1].template == 'A {term} in winter.'
    painter.may_prepare.set()
    bench.until(
        lambda: painter.seen[-1][1].template == 'A {term} in summer.',
        lambda: images.publish(picture(2)),
    )


def test_a_frame_that_takes_too_long_is_told_with_the_remedy(bench, picture):
    diagnostics = bench.findings('heatmaps')
    bench.run(SegmentationNode, Painter(seconds=1.1), template='D')
    images = bench.offer(Image, 'image', qos.IMAGE_OUT)
    bench.until(lambda: bool(diagnostics), lambda: images.publish(picture(5)))
    status = diagnostics[-1]
    assert status.level == WARN
    assert 'a frame takes 1.1 s' in status.message
    assert 'clipseg_max_looks' in status.message


def test_a_slow_segmenter_loses_frames_and_never_gathers_latency(bench, picture, values_of):
    painter = Painter(seconds=0.2)
    heatmaps = bench.heard(Image, 'heatmap', qos.IMAGE_IN)
    diagnostics = bench.findings('heatmaps')
    node = bench.run(SegmentationNode, painter, template='D')
    images = bench.offer(Image, 'image', qos.IMAGE_OUT)
    published = []

    def stream():
        at_ns = node.clock_ns()
        published.append(at_ns)
        images.publish(picture(at_ns))

    bench.until(lambda: len(diagnostics) >= 5, stream)
    assert len(heatmaps) < len(published)
    assert int(values_of(diagnostics[-1])['dropped_frames']) > 0
    latencies = [float(values_of(each)['latency_s']) for each in diagnostics if each.values]
    # Two times the work and some room for a busy machine; a queue of all frames would exceed it.
    assert latencies[-1] < 0.2 * 2 + 0.4
    stamps = [stamp_ns_of(each) for each in heatmaps]
    assert stamps == sorted(stamps)


def test_an_overlay_is_drawn_only_for_those_who_look(bench, picture):
    bench.run(SegmentationNode, Painter(), template='DD')
    overlays = bench.heard(CompressedImage, 'overlay/compressed', qos.IMAGE_IN)
    images = bench.offer(Image, 'image', qos.IMAGE_OUT)
    bench.until(lambda: bool(overlays), lambda: images.publish(picture(3)))
    overlay = frame_from_message(overlays[0])
    assert overlay.image_rgb.shape == (48, 64, 3)
    assert overlay.stamp_ns == 3


def test_a_garbage_image_leaves_the_node_alive_and_says_why(bench, picture):
    heatmaps = bench.heard(Image, 'heatmap', qos.IMAGE_IN)
    diagnostics = bench.findings('heatmaps')
    bench.run(SegmentationNode, Painter(), template='DD')
    images = bench.offer(Image, 'image', qos.IMAGE_OUT)
    garbage = picture(1)
    garbage.step = 5
    bench.until(
        lambda: any('step 5' in each.message for each in diagnostics),
        lambda: images.publish(garbage),
    )
    assert not heatmaps
    bench.until(lambda: bool(heatmaps), lambda: images.publish(picture(9)))


def test_a_garbage_prompt_is_said(bench):
    diagnostics = bench.findings('heatmaps')
    bench.run(SegmentationNode, Painter())
    prompts = bench.offer(DiagnosticArray, 'prompt', qos.RESULT)
    bench.until(lambda: bool(diagnostics), lambda: prompts.publish(DiagnosticArray()))
    assert 'template' in diagnostics[-1].message


def test_a_covered_lens_gives_no_heatmap_and_says_why(bench, picture):
    painter = Painter()
    diagnostics = bench.findings('heatmaps')
    bench.run(SegmentationNode, painter, template='DD')
    images = bench.offer(Image, 'image', qos.IMAGE_OUT)
    covered = picture(7)
    covered.data = bytes(len(covered.data))
    bench.until(lambda: bool(diagnostics), lambda: images.publish(covered))
    assert 'one colour' in diagnostics[-1].message
    assert not painter.seen


def test_a_template_without_words_needs_no_prompts_from_then_on(bench, picture):
    painter = Painter()
    node = bench.run(SegmentationNode, painter)
    images = bench.offer(Image, 'image', qos.IMAGE_OUT)
    images.publish(picture(1))
    assert node.set_parameters([Parameter('template', value='DD')])[0].successful
    bench.until(lambda: bool(painter.seen), lambda: images.publish(picture(2)))
    assert painter.seen[0][1].template == 'A photo of {term}.'
    assert not node.set_parameters([Parameter('template', value='no term')])[0].successful


BENT = replace(
    Camera.from_degrees(64, 48, 90.0),
    distortion=Distortion('plumb_bob', (-0.1, 0.0, 0.0, 0.0, 0.0)),
)


def test_a_heatmap_comes_with_the_camera_and_the_frame_id_of_its_frame(bench, picture):
    heatmaps = bench.heard(Image, 'heatmap', qos.IMAGE_IN)
    frame_infos = bench.heard(CameraInfo, 'heatmap/frame_info', qos.RESULT)
    overlays = bench.heard(CompressedImage, 'overlay/compressed', qos.IMAGE_IN)
    bench.run(SegmentationNode, Painter(), template='DD')
    images = bench.offer(Image, 'image', qos.IMAGE_OUT)
    stamps = iter(range(1, 1000))

    def publish():
        message = picture(next(stamps))
        message.header.frame_id = 'belly_optical'
        images.publish(message)

    bench.until(lambda: heatmaps and frame_infos and overlays, publish)
    assert frame_infos[0].header == heatmaps[0].header
    assert {each.header.frame_id for each in (*heatmaps, *overlays)} == {'belly_optical'}
    size_px = frame_infos[0].width, frame_infos[0].height
    assert frame_infos[0].k[0] == 0.0, 'nothing is known of the lens'
    infos = bench.offer(CameraInfo, 'camera_info', qos.RESULT)
    infos.publish(camera_info(size_px, BENT, 1, 'belly_optical'))
    bench.until(lambda: frame_infos[-1].k[0] > 0.0, publish)
    told = heatmap_from_image(heatmaps[-1], frame_infos[-1])
    assert told.frame_size_px == size_px
    assert told.camera == BENT


def test_images_of_another_size_than_their_camera_info_give_no_heatmap(bench, picture):
    heatmaps = bench.heard(Image, 'heatmap', qos.IMAGE_IN)
    diagnostics = bench.heard(DiagnosticArray, '/diagnostics', qos.RESULT)
    bench.run(SegmentationNode, Painter(), template='DD')
    images = bench.offer(Image, 'image', qos.IMAGE_OUT)
    infos = bench.offer(CameraInfo, 'camera_info', qos.RESULT)
    infos.publish(camera_info((640, 480), Camera.from_degrees(640, 480, 90.0), 1, 'optical'))
    stamps = iter(range(1, 1000))

    def refused():
        return [each for each in diagnostics if '640 x 480 px, the image has' in str(each.status)]

    bench.until(refused, lambda: images.publish(picture(next(stamps))))
    heatmaps.clear()
    for _ in range(3):
        images.publish(picture(next(stamps)))
        time.sleep(0.1)
    assert not heatmaps


def test_frames_are_not_used_after_their_camera_info_has_stopped(bench, picture, monkeypatch):
    monkeypatch.setattr('peace_ros.core.camera_infos.SILENT_S', 0.5)
    heatmaps = bench.heard(Image, 'heatmap', qos.IMAGE_IN)
    found, of_camera = bench.findings('heatmaps'), bench.findings('camera_info')
    bench.run(SegmentationNode, Painter(), template='DD')
    images = bench.offer(Image, 'image', qos.IMAGE_OUT)
    bench.until(lambda: bool(of_camera))
    assert of_camera[-1].message.startswith('none: camera_width')
    infos = bench.offer(CameraInfo, 'camera_info', qos.RESULT)
    stamps = iter(range(1, 1000))

    def see(*, told: bool):
        at_ns = next(stamps)
        if told:
            infos.publish(camera_info((64, 48), BENT, at_ns, 'optical'))
        images.publish(picture(at_ns))

    bench.until(lambda: bool(heatmaps), lambda: see(told=True))
    bench.until(
        lambda: bool(found) and found[-1].message.startswith('no camera_info on /camera_info for'),
        lambda: see(told=False),
    )
    heatmaps.clear()
    bench.until(lambda: bool(heatmaps), lambda: see(told=True))
    bench.until(lambda: of_camera[-1].message.startswith('no camera_info on /camera_info for'))


def test_the_compressed_images_are_beside_the_remapped_image(bench):
    remap = ['--ros-args', '-r', 'image:=/belly/image_raw']
    node = SegmentationNode(
        Painter(),
        cli_args=remap,
        parameter_overrides=[
            Parameter('template', value='DD'),
            Parameter('image_transport', value='compressed'),
        ],
    )
    try:
        topics = {each.topic_name for each in node.subscriptions}
    finally:
        node.close()
        node.destroy_node()
    assert {'/belly/image_raw/compressed', '/belly/camera_info'} <= topics
