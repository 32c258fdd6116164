# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""How well and how fast the networks do."""
