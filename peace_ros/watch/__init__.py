# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A local web page that shows a landing to people; it flies nothing and decides nothing."""
