# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""``peace benchmark``: the frame's stages timed beside the ways that others run the networks."""
