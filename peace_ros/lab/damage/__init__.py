# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Damaged files given to everything that reads files: each is used, or refused in one sentence."""
