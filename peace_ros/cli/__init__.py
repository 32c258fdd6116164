# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The command line ``peace`` and the console scripts."""
