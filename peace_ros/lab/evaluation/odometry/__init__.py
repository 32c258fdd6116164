# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Flies the visual-inertial odometry over drawn ground and compares it with the truth."""
