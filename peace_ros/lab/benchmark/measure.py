# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Times and memory of repeated work."""

from __future__ import annotations

import resource
import sys
import time
from collections import defaultdict
from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from peace_ros.core.domain import Frame

Stage = Callable[[str], AbstractContextManager[None]]
"""Times one run of a named stage."""


@dataclass(frozen=True)
class Spread:
    """How long something took, milliseconds."""

    p50: float
    p95: float
    p99: float
    mean: float

    @classmethod
    def of(cls, times_ms: Sequence[float]) -> Spread:
        """Summarise times, milliseconds."""
        p50, p95, p99 = (float(each) for each in np.percentile(times_ms, [50, 95, 99]))
        return cls(p50, p95, p99, float(np.mean(times_ms)))


@dataclass
class Stopwatch:
    """Gathers the times of named stages."""

    times_ms: dict[str, list[float]] = field(default_factory=lambda: defaultdict(list))
    processor_ms: dict[str, list[float]] = field(default_factory=lambda: defaultdict(list))
    """Processor time of all threads, which other programs on the machine hardly change."""

    @contextmanager
    def stage(self, name: str) -> Iterator[None]:
        """Time one run of a stage."""
        start, start_processor = time.perf_counter(), time.process_time()
        yield
        self.processor_ms[name].append((time.process_time() - start_processor) * 1e3)
        self.times_ms[name].append((time.perf_counter() - start) * 1e3)

    def warmed(self, frames: Sequence[Frame]) -> Iterator[tuple[Frame, Stage]]:
        """Yield each frame with what times its stages; the first comes before that, not timed."""
        yield frames[0], Stopwatch().stage
        for frame in frames:
            yield frame, self.stage

    def processor_p50(self, name: str) -> float:
        """Return the median processor time of a stage, milliseconds."""
        return float(np.median(self.processor_ms[name]))

    def spreads(self) -> dict[str, Spread]:
        """Return stage -> how long it took."""
        return {name: Spread.of(times) for name, times in self.times_ms.items()}

    def measured(self, name: str, conditions: str, **extra: Any) -> Measured:
        """Return what was timed up to now, with the memory in use up to now."""
        return Measured(
            name,
            conditions,
            self.spreads(),
            len(self.times_ms['frame']),
            peak_rss_mb(),
            self.processor_p50('frame'),
            extra,
        )


@dataclass(frozen=True)
class Measured:
    """What one way of running the networks took."""

    name: str
    conditions: str
    stages_ms: dict[str, Spread]
    """Stage -> time; ``frame`` is camera image in, heatmap out."""
    frames: int
    peak_rss_mb: float
    processor_ms: float
    """Processor time of a frame, median; beside the wall clock it tells a busy machine."""
    extra: dict[str, Any] = field(default_factory=dict)
    """Figures that only this way has."""


def peak_rss_mb() -> float:
    """Return the most memory that this process has held at once, megabytes (10^6 bytes)."""
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    # Linux counts kibibytes, macOS bytes.
    return peak * (1 if sys.platform == 'darwin' else 1024) / 1e6
