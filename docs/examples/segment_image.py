# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Segment one image, without an argument a drawn town; writes overlay.png."""

import sys

import cv2

from peace_ros.core.domain import Frame
from peace_ros.core.pipeline import Pipeline
from peace_ros.core.segmentation import draw_overlay
from peace_ros.simulation.world import draw_world

if len(sys.argv) > 1:
    image_rgb = cv2.cvtColor(cv2.imread(sys.argv[1]), cv2.COLOR_BGR2RGB)
else:
    image_rgb = draw_world(seed=1, size_m=100.0, gsd_m=0.2).image_rgb

look = Pipeline.from_preset('peace_cs').look(Frame(image_rgb, stamp_ns=0))
print(f'prompt: {look.prompt.template}')
print(f'{100 * (look.heatmap.safety >= 0.5).mean():.1f} % of the image is called safe')
overlay_rgb = draw_overlay(look.frame, look.heatmap)
cv2.imwrite('overlay.png', cv2.cvtColor(overlay_rgb, cv2.COLOR_RGB2BGR))
