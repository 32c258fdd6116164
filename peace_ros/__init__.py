# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""PEACE: find a place below a drone where landing hurts nobody, and go there."""

__version__ = '0.1.0'
