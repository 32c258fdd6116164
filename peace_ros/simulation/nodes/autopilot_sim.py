# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The autopilot_sim node: a simulated MAVLink autopilot, with its true pose for the camera."""

from __future__ import annotations

import sys
import threading
import time
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from geometry_msgs.msg import PoseStamped
from rosgraph_msgs.msg import Clock

from peace_ros.nodes.messages import pose_to_message, time_from_ns
from peace_ros.nodes.node import PeaceNode
from peace_ros.nodes.qos import CLOCK, POSE
from peace_ros.nodes.runtime import run
from peace_ros.simulation.autopilot import AutopilotParameters, AutopilotSim
from peace_ros.simulation.nodes.options import AUTOPILOT_SIM, AutopilotSimOptions

_CLOCK_PERIOD_S = 0.006
"""Wall time between two messages on /clock, at least."""


class AutopilotSimNode(PeaceNode):
    """Publishes what the simulation does; nothing here is known to the companion."""

    def __init__(self, **options: Any) -> None:
        """Open the MAVLink port and begin to fly.

        Raises:
            PeaceError: parameters cannot be used or the port is taken.
        """
        super().__init__('autopilot_sim', *AUTOPILOT_SIM, **options)
        parameters = self.filled(AutopilotParameters)
        chosen = self.filled(AutopilotSimOptions)
        self._sim = AutopilotSim(parameters)
        if chosen.ground_station_address is not None:
            self._sim.call(*chosen.ground_station_address)
        self._pose_period_ns = round(1e9 / chosen.pose_rate)
        self._pose_due_ns = 0
        self._clock_due_s = 0.0
        self._has_clock = chosen.publish_clock or parameters.speed != 1.0
        # A clock that begins at zero would mean "no time yet" to ROS.
        self._epoch_ns = time.time_ns()
        self._pose_out = self.create_publisher(PoseStamped, 'ground_truth/pose', POSE)
        self._clock_out = self.create_publisher(Clock, '/clock', CLOCK)
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._fly, name='autopilot_sim', daemon=True)
        self._thread.start()
        self.get_logger().info(f'ready: MAVLink at {self._sim.url}, speed {parameters.speed:g}')

    def _fly(self) -> None:
        try:
            self._sim.run(self._stop, self._on_step)
        except Exception as error:
            self.fail(error)

    def _on_step(self, sim: AutopilotSim) -> None:
        at_ns = sim.time_ns
        now_s = time.monotonic()
        if self._has_clock and now_s >= self._clock_due_s:
            self._clock_due_s = now_s + _CLOCK_PERIOD_S
            self._clock_out.publish(Clock(clock=time_from_ns(self._epoch_ns + at_ns)))
        if at_ns < self._pose_due_ns:
            return
        self._pose_due_ns = at_ns - at_ns % self._pose_period_ns + self._pose_period_ns
        truth = sim.truth()
        stamp_ns = self._epoch_ns + truth.stamp_ns if self._has_clock else self.clock_ns()
        self._pose_out.publish(pose_to_message(replace(truth, stamp_ns=stamp_ns)))

    def close(self) -> None:
        """Stop flying and release the port."""
        self._stop.set()
        self._thread.join(timeout=2.0)
        self._sim.close()


def main(args: Sequence[str] | None = None) -> int:
    """Run the node until SIGINT or SIGTERM."""
    return run(AutopilotSimNode, args)


if __name__ == '__main__':
    sys.exit(main())
