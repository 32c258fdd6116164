# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Segment one image, without an argument a drawn town; writes overlay.png."""

import sys

import cv2

from peace_ros.core.domain import Frame
from peace_ros.core.inference import Bundle, ClipEncoder
from peace_ros.core.prompting import PromptGenerator, PromptingParameters, load_vocabularies
from peace_ros.core.segmentation import SegmentationParameters as Parameters
from peace_ros.core.segmentation import create_segmenter, draw_overlay, load_terms
from peace_ros.simulation.world import draw_world

if len(sys.argv) > 1:
    image_rgb = cv2.cvtColor(cv2.imread(sys.argv[1]), cv2.COLOR_BGR2RGB)
else:
    image_rgb = draw_world(seed=1, size_m=100.0, gsd_m=0.2).image_rgb
frame = Frame(image_rgb, stamp_ns=0)
words = load_vocabularies('vocabularies.yaml')
generator = PromptGenerator(ClipEncoder(Bundle.load('clip-small')), words, PromptingParameters())
terms, bundle = load_terms('terms.yaml'), Bundle.load('clipseg-small')
prompt = generator.generate(frame)
heatmap = create_segmenter('clipseg', bundle, terms, Parameters()).segment(frame, prompt)
print(f'prompt: {prompt.template}')
print(f'{100 * (heatmap.safety >= 0.5).mean():.1f} % of the image is called safe')
cv2.imwrite('overlay.png', cv2.cvtColor(draw_overlay(frame, heatmap), cv2.COLOR_RGB2BGR))
