# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The experiment of the PEACE paper: many landings from the same starts, judged by ground truth."""
