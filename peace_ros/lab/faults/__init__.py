# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Everything that may fail, put into a flight of the real processes, and what must happen then."""
