# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What measures, trains and exports; nothing of it is needed to fly."""
