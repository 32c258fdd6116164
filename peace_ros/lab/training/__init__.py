# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Trains the bundled models from drawn scenes and real images; the only room that needs torch."""
