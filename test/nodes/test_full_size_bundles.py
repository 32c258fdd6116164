# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Node processes run CLIP and CLIPSeg of the true sizes when ``bundle`` names them, and no more."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip('torch')
pytest.importorskip('transformers')

from diagnostic_msgs.msg import DiagnosticArray
from sensor_msgs.msg import Image

from peace_ros.core.messages import heatmap_from_image, prompt_from_message, stamp_ns_of
from peace_ros.lab.benchmark.bundles import build_random
from peace_ros.nodes import qos
from peace_ros.nodes.messages import image_message
from peace_ros.simulation.demo.nodes import MODULES
from peace_ros.simulation.demo.processes import ProcessGroup, log_tail

pytestmark = [pytest.mark.export, pytest.mark.integration, pytest.mark.slow]

LIMIT_S = 240.0


@pytest.fixture(scope='module')
def bundles(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp('bundles')
    for name in ('clipseg-rd64-fp32', 'clip-vit-b-32-fp32'):
        build_random([name], str(folder))
    return folder


def test_one_parameter_changes_the_model_of_a_node(
    bench: Any, bundles: Path, tmp_path: Path
) -> None:
    heatmaps = bench.heard(Image, 'heatmap', qos.IMAGE_IN)
    prompts = bench.heard(DiagnosticArray, 'prompt', qos.RESULT)
    pixels = np.random.default_rng(0).integers(0, 256, (240, 320, 3), np.uint8)
    chosen = {'prompt_generator': 'clip-vit-b-32-fp32', 'segmentation': 'clipseg-rd64-fp32'}
    with ProcessGroup(tmp_path) as nodes:
        for node, bundle in chosen.items():
            given = ['--ros-args', '-p', f'bundle:={bundles / bundle}']
            nodes.start(node, MODULES[node], given)
        images = bench.peer.create_publisher(Image, 'image', qos.IMAGE_OUT)
        stamps = iter(range(10**9, 10**12, 10**8))

        def publish() -> None:
            nodes.check()
            images.publish(image_message(pixels, 'rgb8', next(stamps)))

        bench.until(lambda: bool(heatmaps), publish, within_s=LIMIT_S)
    heatmap = heatmap_from_image(heatmaps[0])
    assert heatmap.safety.shape == (352, 352)
    assert heatmap.safety.std() > 0.01
    assert heatmap.stamp_ns >= stamp_ns_of(prompts[0]) >= 10**9
    assert len(prompt_from_message(prompts[0]).ranking) >= 3
    for node, bundle in chosen.items():
        assert f'{bundle} fp32 on CPUExecutionProvider' in log_tail(tmp_path / f'{node}.log', 50)
