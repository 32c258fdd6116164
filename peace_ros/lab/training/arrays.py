# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Short names of the types that every drawing function takes."""

import numpy as np
from numpy.typing import NDArray

Image = NDArray[np.uint8]
"""RGB [H, W, 3], or pixel classes [H, W]."""
Points = NDArray[np.float64]
"""Corners [N, 2] in pixels, x and y; or one such vector [2]."""
Rng = np.random.Generator
