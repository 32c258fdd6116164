# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Reference checkpoints -> model bundles; needs the ``export`` extra (torch, transformers).

Only the modules below import torch, and nothing outside this package imports them at load time:
the rest of the project runs without it.
"""
