# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Checks of an installation before a flight; nothing is changed, and no set-point is sent."""
