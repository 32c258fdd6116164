# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The main job, end to end: processes, the pilot's part, progress, the run folder."""
