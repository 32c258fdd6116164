# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A segmenter of your own, here: green is safe. The segmentation node takes it as any other."""

from dataclasses import dataclass

import numpy as np

import peace_ros.core.segmentation as seg
from peace_ros.core.domain import Heatmap
from peace_ros.core.domain.parameters import ParameterSet, parameter
from peace_ros.core.pipeline import Pipeline, create_generator
from peace_ros.core.prompting import PromptingParameters
from peace_ros.simulation.world import draw_world


@dataclass(frozen=True)
class GreenParameters(ParameterSet):
    green_gain: float = parameter(4.0, 'Score per share of green', low=0.1, high=100.0)


class GreenSegmenter(seg.Segmenter):
    def __init__(self, bundle, terms, parameters, own):
        self.terms, self.gain = terms, own.green_gain

    def segment(self, frame, prompt):
        red, green, blue = np.moveaxis(frame.image_rgb.astype(np.float32) / 255.0, 2, 0)
        safety = np.clip(0.5 + self.gain * (green - np.maximum(red, blue)), 0.0, 1.0)
        return Heatmap(safety, frame.stamp_ns)


seg.FAMILIES['green'] = seg.Family(GreenSegmenter, GreenParameters)
segmenter = seg.create_segmenter(seg.SegmentationParameters(family='green'))
pipeline = Pipeline(segmenter, create_generator(PromptingParameters(template='DD')))
heatmap = pipeline.segment(draw_world(seed=1, size_m=100.0, gsd_m=0.2).image_rgb)
print(f'{100 * (heatmap.safety >= 0.5).mean():.1f} % of the image is called safe')
