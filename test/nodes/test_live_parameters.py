# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What a person changes while the nodes run is in force from the next frame on, or refused."""

from __future__ import annotations

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticArray
from rclpy.parameter import Parameter
from sensor_msgs.msg import Image

from peace_ros.core.messages import heatmap_from_image, prompt_from_message
from peace_ros.nodes import qos
from peace_ros.nodes.landing import LandingNode
from peace_ros.nodes.prompt_generator import PromptGeneratorNode
from peace_ros.nodes.segmentation import SegmentationNode


def change(node, **values):
    given = [Parameter(name, value=value) for name, value in values.items()]
    return node.set_parameters_atomically(given)


def test_template_and_vocabularies_of_the_prompts_change(bench, picture, clip_folder, tmp_path):
    prompts = bench.heard(DiagnosticArray, 'prompt', qos.RESULT)
    node = bench.run(PromptGeneratorNode, bundle=str(clip_folder))
    images = bench.offer(Image, 'image', qos.IMAGE_OUT)

    def newest() -> str:
        return prompt_from_message(prompts[-1]).template if prompts else ''

    def see() -> None:
        images.publish(picture(node.clock_ns()))

    bench.until(lambda: bool(newest()), see)
    words = tmp_path / 'words.yaml'
    words.write_text('resolution: [sharp]\nframe: [photo]\nenvironment: [tundra]\n')
    assert change(node, vocabularies=str(words), template='A {term} in {environment}.').successful
    bench.until(lambda: newest() == 'A {term} in tundra.', see)
    refused = change(node, vocabularies='/nowhere.yaml', template='DD')
    assert (refused.successful, '/nowhere.yaml' in refused.reason) == (True, False)
    bench.until(lambda: newest() == 'A photo of {term}.', see)
    refused = change(node, template='PEACE')
    assert not refused.successful
    assert '/nowhere.yaml' in refused.reason
    assert newest() == 'A photo of {term}.'
    refused = change(node, bundle='other')
    assert not refused.successful
    assert 'read-only' in refused.reason


def test_terms_and_template_of_the_heatmaps_change(bench, picture, clipseg_folder, tmp_path):
    heatmaps = bench.heard(Image, 'heatmap', qos.IMAGE_IN)
    node = bench.run(SegmentationNode, bundle=str(clipseg_folder), template='DD')
    images = bench.offer(Image, 'image', qos.IMAGE_OUT)

    def safety() -> np.ndarray:
        seen = len(heatmaps)
        bench.until(
            lambda: len(heatmaps) > seen + 1, lambda: images.publish(picture(node.clock_ns()))
        )
        return heatmap_from_image(heatmaps[-1]).safety

    before = safety()
    terms = tmp_path / 'terms.yaml'
    terms.write_text('positive: [car]\nnegative: [grass, road, building]\n')
    assert change(node, terms=str(terms)).successful
    assert not np.array_equal(safety(), before)
    other = tmp_path / 'other.yaml'
    other.write_text('positive: []\nnegative: [car]\n')
    refused = change(node, terms=str(other), overlay_quality=20)
    assert not refused.successful
    assert node.get_parameter('overlay_quality').value == 80
    assert not change(node, overlay_threshold=1.5).successful
    assert change(node, overlay_threshold=0.7, overlay_quality=20).successful


@pytest.fixture
def landing(bench):
    node = bench.run(LandingNode, interface='twist')
    see = bench.offer_safe_ground(node, 60.0)
    return node, see


def test_the_threshold_changes_before_a_landing_and_not_during_one(bench, landing, values_of):
    node, see = landing
    statuses = bench.heard(DiagnosticArray, 'landing/status', qos.RESULT)

    def threshold() -> float:
        values = values_of(statuses[-1]) if statuses else {}
        return float(values.get('effective_threshold', 'nan'))

    assert change(node, safety_threshold=0.9).successful
    bench.until(lambda: threshold() == pytest.approx(0.9), see)
    assert not change(node, safety_threshold=0.1).successful
    assert not change(node, safety_threshold=0.65).successful  # below relaxed_threshold
    bench.until(lambda: not node.check_engagement(), see)
    assert node.begin() == ''
    bench.until(lambda: values_of(statuses[-1])['state'] != 'IDLE', see)
    refused = change(node, safety_threshold=0.8)
    assert not refused.successful
    assert 'disengage' in refused.reason
    node.end_landing()
    bench.until(lambda: values_of(statuses[-1])['state'] == 'IDLE', see)
    assert change(node, safety_threshold=0.8).successful
