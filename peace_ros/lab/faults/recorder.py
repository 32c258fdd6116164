# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A recorder beside the landing whose disk is full after some bytes: ``recorder FILE BYTES``."""

from __future__ import annotations

import resource
import sys
import time
from pathlib import Path

from peace_ros.core.domain import PeaceError
from peace_ros.nodes.runtime import EXIT_REFUSED
from peace_ros.recording import BagWriter
from peace_ros.simulation.demo.monitor import Monitor

_LOOK_S = 0.1


def main() -> int:
    """Record every topic until the file may not grow any more; then say so and end."""
    path, limit = Path(sys.argv[1]), int(sys.argv[2])
    # What a write over this limit gives (EFBIG) is treated as what a full disk gives (ENOSPC).
    resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit))
    try:
        with BagWriter(path) as writer:
            monitor = Monitor(writer, use_sim_time=False)
            try:
                while True:
                    monitor.check()
                    time.sleep(_LOOK_S)
            finally:
                monitor.close()
    except PeaceError as error:
        print(error, file=sys.stderr, flush=True)
        return EXIT_REFUSED


if __name__ == '__main__':
    sys.exit(main())
