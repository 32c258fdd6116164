# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""How charts look in all report pages; the same figures give the same bytes."""

from __future__ import annotations

from typing import Any

CHART_STYLE: dict[Any, Any] = {
    'svg.fonttype': 'none',
    'svg.hashsalt': 'peace_ros',
    'font.family': 'sans-serif',
    'font.sans-serif': ['system-ui', 'DejaVu Sans'],
    'axes.titleweight': 'bold',
    'axes.titlelocation': 'left',
    'axes.grid': True,
    'axes.axisbelow': True,
    'axes.spines.top': False,
    'axes.spines.right': False,
    'axes.edgecolor': '#8c959f',
    'grid.color': '#e4e7eb',
}
"""For ``matplotlib.rc_context``."""
