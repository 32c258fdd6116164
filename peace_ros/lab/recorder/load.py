# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Measures what the recorder costs beside a landing at its usual rates.

    python -m peace_ros.lab.recorder.load --seconds 60

The processor time of the recorder's process is counted, so other work on the machine matters
little. Frames are 640 x 480 px, raw, 5 per second; all other topics of a landing come too.
"""

from __future__ import annotations

import json
import tempfile
import time
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Annotated

import psutil
import typer

from peace_ros.core.domain import RecordingError
from peace_ros.lab.recorder.landing_topics import (
    LandingTopics,
    newest_recording,
    recorder_process,
)
from peace_ros.recording import BagReader
from peace_ros.simulation.demo.isolation import isolate

MOST_CPU = 0.05
_SETTLE_S = 4.0
_START_S = 60.0


@dataclass(frozen=True)
class RecorderLoad:
    """What was measured."""

    seconds: float
    cpu_share: float
    """Of one core."""
    memory_mb: float
    """Resident."""
    file_kb_s: float
    frames_hz: float


def measure_load(seconds: float) -> RecorderLoad:
    """Record for a while; return what that took.

    Raises:
        RecordingError: nothing was recorded.
    """
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place) / 'recordings'
        isolate(Path(place) / 'ros')
        with LandingTopics(), recorder_process(folder) as process:
            path = newest_recording(folder, _START_S)
            if path is None:
                raise RecordingError(f'the recorder wrote nothing into {folder} within a minute')
            time.sleep(_SETTLE_S)
            watched = psutil.Process(process.pid)
            begin, began_s, size = watched.cpu_times(), time.monotonic(), path.stat().st_size
            time.sleep(seconds)
            end, elapsed_s = watched.cpu_times(), time.monotonic() - began_s
            memory_mb = watched.memory_info().rss / 1e6
            grown = path.stat().st_size - size
        used_s = end.user + end.system - begin.user - begin.system
        with BagReader(path) as bag:
            frames = [at_ns for _, at_ns, _ in bag.messages(['/image/compressed'])]
        span_s = (frames[-1] - frames[0]) * 1e-9 if len(frames) > 1 else float('inf')
    return RecorderLoad(
        round(elapsed_s, 1),
        round(used_s / elapsed_s, 4),
        round(memory_mb, 1),
        round(grown / elapsed_s / 1e3, 1),
        round((len(frames) - 1) / span_s, 2),
    )


def main(
    seconds: Annotated[float, typer.Option(help='For how long it is measured.')] = 60.0,
) -> None:
    """Measure, print the result as JSON, and exit with status 1 above 5 % of a core."""
    load = measure_load(seconds)
    typer.echo(json.dumps(asdict(load)))
    if load.cpu_share > MOST_CPU:
        raise typer.Exit(1)


if __name__ == '__main__':
    typer.run(main)
