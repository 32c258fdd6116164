# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""How safe what a heatmap calls safe is: ``peace evaluate``."""
