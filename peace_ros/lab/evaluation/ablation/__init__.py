# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Which words, templates, fusions and thresholds earn their place: ``peace ablate``."""
