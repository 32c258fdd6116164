# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Training of the bundled FastSAM-like segmenter and of the CLIP-like pair that names segments."""
