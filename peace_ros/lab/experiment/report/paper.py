# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What the PEACE paper reports, table "aggregated results": 100 runs each, judged by eye."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class PaperResult:
    """One column of the table."""

    name: str
    safe_of_100: int
    horizontal_distance_m: float
    time_s: float
    miou_percent: float
    """On 400 images of UAVid, not on the flights."""
    inference_hz: float
    """On an Orin AGX."""


PAPER = {
    'dd_cs': PaperResult('DD-CS', 76, 81.0, 506.0, 38.0, 1.90),
    'd_cs': PaperResult('D-CS', 57, 74.4, 844.0, 34.0, 1.89),
    'peace_cs': PaperResult('PEACE-CS', 92, 100.3, 594.0, 41.0, 0.82),
    'dd_fs': PaperResult('DD-FS', 80, 88.7, 513.0, 43.0, 2.70),
    'd_fs': PaperResult('D-FS', 61, 83.1, 901.0, 41.0, 2.66),
    'peace_fs': PaperResult('PEACE-FS', 93, 103.2, 612.0, 47.0, 0.78),
}
