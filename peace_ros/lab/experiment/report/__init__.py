# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The report of an experiment: one page that needs no other file, and figures for papers."""
