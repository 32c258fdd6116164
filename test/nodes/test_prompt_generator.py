# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The prompt carries the stamp of its frame, and bad frames do not end the node."""

from __future__ import annotations

from diagnostic_msgs.msg import DiagnosticArray
from sensor_msgs.msg import CompressedImage, Image

from peace_ros.core.domain import Prompt, RankedWord
from peace_ros.core.messages import prompt_from_message, stamp_ns_of
from peace_ros.nodes import qos
from peace_ros.nodes.messages import jpeg_message
from peace_ros.nodes.prompt_generator import PromptGeneratorNode


class Describer:
    def generate(self, frame):
        words = (RankedWord('winter', 0.4), RankedWord('summer', 0.1))
        return Prompt('A {term} in winter.', frame.stamp_ns, {'environment': words})


def test_the_prompt_carries_the_stamp_of_the_frame(bench, picture):
    prompts = bench.heard(DiagnosticArray, 'prompt', qos.RESULT)
    bench.run(PromptGeneratorNode, Describer())
    images = bench.offer(Image, 'image', qos.IMAGE_OUT)
    bench.until(lambda: bool(prompts), lambda: images.publish(picture(123_000_000_456)))
    prompt = prompt_from_message(prompts[0])
    assert prompt.stamp_ns == 123_000_000_456
    assert prompt.template == 'A {term} in winter.'
    assert prompt.ranking['environment'][0] == RankedWord('winter', 0.4)


def test_takes_compressed_images(bench):
    prompts = bench.heard(DiagnosticArray, 'prompt', qos.RESULT)
    bench.run(PromptGeneratorNode, Describer(), image_transport='compressed')
    images = bench.offer(CompressedImage, 'image/compressed', qos.IMAGE_OUT)
    frame = jpeg_message(pixels(), 77, 90)
    bench.until(lambda: bool(prompts), lambda: images.publish(frame))
    assert stamp_ns_of(prompts[0]) == 77


def pixels():
    import numpy as np

    return np.full((20, 30, 3), 128, np.uint8)


def test_a_garbage_image_is_said_and_the_next_one_is_described(bench, picture):
    prompts = bench.heard(DiagnosticArray, 'prompt', qos.RESULT)
    diagnostics = bench.findings('prompts')
    bench.run(PromptGeneratorNode, Describer())
    images = bench.offer(Image, 'image', qos.IMAGE_OUT)
    garbage = picture(1)
    garbage.encoding = 'unheard_of'
    bench.until(
        lambda: any('unheard_of' in each.message for each in diagnostics),
        lambda: images.publish(garbage),
    )
    assert not prompts
    bench.until(lambda: bool(prompts), lambda: images.publish(picture(2)))
    assert stamp_ns_of(prompts[0]) == 2


def test_a_static_template_needs_no_model(bench, picture):
    prompts = bench.heard(DiagnosticArray, 'prompt', qos.RESULT)
    bench.run(PromptGeneratorNode, template='DD', bundle='/no/such/bundle')
    images = bench.offer(Image, 'image', qos.IMAGE_OUT)
    bench.until(lambda: bool(prompts), lambda: images.publish(picture(5)))
    assert prompt_from_message(prompts[0]) == Prompt('A photo of {term}.', 5)
