# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Worlds from web-map tiles (XYZ), kept in a cache on disk so that they can be flown offline."""
