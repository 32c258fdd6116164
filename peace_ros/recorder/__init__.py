# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The flight recorder: a process beside the landing that writes what happens, and no more."""
