# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""``peace benchmark``: times of a frame, compared with the ways that others run the networks."""
