# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A configuration whose segmenter reads its scores off the image's green channel."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from peace_ros.core.domain import Frame, Heatmap, Prompt
from peace_ros.core.inference import Bundle
from peace_ros.core.pipeline import Pipeline
from peace_ros.core.prompting import PromptGenerator, PromptingParameters
from peace_ros.core.segmentation import SegmentationParameters, Segmenter, Terms
from peace_ros.lab.evaluation.segmentation.cores import Cores

TERMS = Terms(('grass', 'lawn'), ('water', 'spaceship'))


class GreenSegmenter(Segmenter):
    """Calls safe what is green; water is what is blue."""

    terms = TERMS

    def segment(self, frame: Frame, prompt: Prompt) -> Heatmap:
        return Heatmap(self._channel(frame, 1), frame.stamp_ns)

    def term_maps(self, frame: Frame, prompt: Prompt) -> NDArray[np.float32]:
        green, blue = self._channel(frame, 1), self._channel(frame, 2)
        return np.stack([green, green, blue, blue])

    def _channel(self, frame: Frame, channel: int) -> NDArray[np.float32]:
        return frame.image_rgb[..., channel].astype(np.float32) / np.float32(255.0)


@pytest.fixture(scope='session')
def green_cores() -> Cores:
    prompting = PromptingParameters(template='DD')
    return Cores(
        'green',
        Pipeline(GreenSegmenter(), PromptGenerator(None, None, prompting)),
        Bundle.load('clipseg-small'),
        prompting,
        SegmentationParameters(),
        None,
    )


@pytest.fixture
def pair_on_disk(tmp_path: Path) -> Callable[..., SimpleNamespace]:
    """Write image and label files; return their folders."""

    def write(name: str, image: NDArray[np.uint8], labels: NDArray[Any] | None) -> SimpleNamespace:
        folders = SimpleNamespace(images=tmp_path / 'images', labels=tmp_path / 'labels')
        for folder in (folders.images, folders.labels):
            folder.mkdir(exist_ok=True)
        cv2.imwrite(str(folders.images / f'{name}.png'), image[..., ::-1])
        if labels is not None:
            cv2.imwrite(str(folders.labels / f'{name}.png'), labels)
        return folders

    return write
