# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The ``landing`` node with an executor that can be stalled: topic ``fault/stall`` (Float64)."""

from __future__ import annotations

import sys
import time
from typing import Any

from std_msgs.msg import Float64

from peace_ros.nodes.landing import LandingNode
from peace_ros.nodes.qos import RESULT
from peace_ros.nodes.runtime import run


class StallableLandingNode(LandingNode):
    """Its steps wait behind a callback that takes as long as it is told."""

    def __init__(self, **options: Any) -> None:
        super().__init__(**options)
        # In the group of the timer that steps, so that the executor runs one of the two.
        self.create_subscription(
            Float64, 'fault/stall', lambda message: time.sleep(message.data), RESULT
        )


def main() -> int:
    """Run the node until SIGINT or SIGTERM."""
    return run(StallableLandingNode)


if __name__ == '__main__':
    sys.exit(main())
