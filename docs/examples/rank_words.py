# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Rank the words of the vocabularies against one image; without an argument, a drawn town."""

import sys

import cv2

from peace_ros.core.domain import Frame
from peace_ros.core.pipeline import create_generator
from peace_ros.core.prompting import PromptingParameters
from peace_ros.simulation.world import draw_world

if len(sys.argv) > 1:
    image_rgb = cv2.cvtColor(cv2.imread(sys.argv[1]), cv2.COLOR_BGR2RGB)
else:
    image_rgb = draw_world(seed=1, size_m=100.0, gsd_m=0.2).image_rgb

generator = create_generator(PromptingParameters(template='PEACE'))
prompt = generator.generate(Frame(image_rgb, stamp_ns=0))
for category, words in prompt.ranking.items():
    best = ', '.join(f'{ranked.word} {ranked.score:.3f}' for ranked in words[:4])
    print(f'{category}: {best}')  # cosine similarity, the best word first
print(prompt.text_for('grass'))
