# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Trials of the flight recorder: what it costs, and what a cut of the power leaves."""
