# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The matrix's own node: it hears the landing, and stands between the other nodes as a relay."""

from __future__ import annotations

import heapq
import threading
import time
from bisect import bisect_left
from collections import OrderedDict, deque
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PoseStamped
from rclpy.qos import QoSProfile
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import Image
from std_msgs.msg import Float64, String
from std_srvs.srv import Trigger

from peace_ros.core.domain import Pose
from peace_ros.core.messages import diagnostic_values, ns_from_time, pose_from_message
from peace_ros.lab.faults.record import Said, TruthSample
from peace_ros.lab.faults.tamper import Tamper, untouched
from peace_ros.nodes import qos
from peace_ros.nodes.messages import time_from_ns
from peace_ros.simulation.demo.listener import Listener

IMAGE, HEATMAP, PROMPT = 'image', 'heatmap', 'prompt'
RAW = 'raw/'
"""Before the name of a topic: what the real publisher says, which only the relay hears."""
_RELAYED: dict[str, tuple[Any, Any, Any]] = {
    IMAGE: (Image, qos.IMAGE_IN, qos.IMAGE_OUT),
    HEATMAP: (Image, qos.IMAGE_IN, qos.IMAGE_OUT),
    PROMPT: (DiagnosticArray, qos.RESULT, qos.RESULT),
}
_EVIDENCE = QoSProfile(depth=1000)
"""Reliable and deep: a busy bench hears status and ground truth late, but misses none."""
_KEPT_POSES = 6000
"""Two minutes of ground truth."""
_KEPT_TURNS = 30_000
_NEAR_NS = 300_000_000
_RELEASE_S = 0.01


class BenchNode(Listener):
    """Spins in a thread of its own; the lists are read under :attr:`lock`.

    All times are of the steady clock. Those of status and ground truth are the times at which they
    were published, so that they hold on a busy machine too.
    """

    def __init__(self) -> None:
        self.lock = threading.Condition()
        """Notified when a status or a pose has come."""
        self.said: list[Said] = []
        self.values: dict[str, str] = {}
        """Pairs of the newest status."""
        self.truths: list[TruthSample] = []
        self.heatmaps = 0
        """Heatmaps that were handed on since the last :meth:`forget`."""
        self.heatmaps_s: list[float] = []
        """When the segmentation node gave a heatmap, whether it was handed on or not."""
        self.turns_s: deque[float] = deque(maxlen=_KEPT_TURNS)
        """When the relay looked at its queue: every 10 ms while it gets the processor."""
        self.clock_step_ns = 0
        """Added to ``/clock``."""
        self._tampers: dict[str, Tamper] = dict.fromkeys(_RELAYED, untouched)
        self._poses: OrderedDict[int, Pose] = OrderedDict()
        self._since_s = time.monotonic()
        self._epoch_s = time.time() - self._since_s
        """Zero of the steady clock, on the wall clock."""
        self._queue: list[tuple[float, int, str, Any]] = []
        self._count = 0
        super().__init__('fault_bench')
        self._out = {
            name: self.node.create_publisher(kind, name, out)
            for name, (kind, _, out) in _RELAYED.items()
        }
        for name, (kind, into, _) in _RELAYED.items():
            self.node.create_subscription(kind, RAW + name, self._relay(name), into)
        self._clock_out = self.node.create_publisher(Clock, '/clock', qos.CLOCK)
        self.node.create_subscription(Clock, RAW + 'clock', self._on_clock, qos.CLOCK)
        self.node.create_subscription(DiagnosticArray, 'landing/status', self._on_status, _EVIDENCE)
        self.node.create_subscription(PoseStamped, 'ground_truth/pose', self._on_pose, _EVIDENCE)
        self._stall = self.node.create_publisher(Float64, 'fault/stall', qos.RESULT)
        self._defect = self.node.create_publisher(String, 'fault/defect', qos.RESULT)
        self._model = self.node.create_publisher(String, 'fault/model', qos.RESULT)
        self.node.create_timer(_RELEASE_S, self._release)
        self.start()

    def forget(self) -> None:
        """Forget what was heard, and hand everything on again."""
        with self.lock:
            self.said.clear()
            self.values = {}
            self.truths.clear()
            self._since_s = time.monotonic()
            self._epoch_s = time.time() - self._since_s
            self.heatmaps = 0
            self.heatmaps_s.clear()
            self.clock_step_ns = 0
            self._queue.clear()
            self._tampers = dict.fromkeys(_RELAYED, untouched)

    def tamper(self, topic: str, tamper: Tamper | None) -> None:
        """Put a tamper on a topic; None hands on what comes."""
        with self.lock:
            self._tampers[topic] = tamper or untouched

    def pose_at(self, at_ns: int) -> Pose | None:
        """Return the true pose of that stamp, or the nearest one heard; None when none is near.

        A picture may overtake the pose that it was drawn from.
        """
        with self.lock:
            if at_ns in self._poses:
                return self._poses[at_ns]
            nearest = min(self._poses, key=lambda stamp: abs(stamp - at_ns), default=None)
            if nearest is None or abs(nearest - at_ns) > _NEAR_NS:
                return None
            return self._poses[nearest]

    def pose_near(self, at_s: float) -> Pose | None:
        """Return the true pose that was published next to a moment."""
        with self.lock:
            after = bisect_left(self.truths, at_s, key=lambda truth: truth.at_s)
            near = self.truths[max(0, after - 1) : after + 1]
            nearest = min(near, key=lambda truth: abs(truth.at_s - at_s), default=None)
            return None if nearest is None else self._poses.get(nearest.stamp_ns)

    def site(self) -> tuple[float, float] | None:
        """Return north and east of the site that the landing has chosen, None without one."""
        with self.lock:
            values = self.values
        try:
            return float(values['site_north_m']), float(values['site_east_m'])
        except (KeyError, ValueError):
            return None

    def newest_pose(self) -> Pose | None:
        """Return the true pose heard last."""
        with self.lock:
            return next(reversed(self._poses.values()), None)

    def stall_landing(self, seconds: float) -> None:
        """Let a callback of the landing node take so long."""
        self._stall.publish(Float64(data=seconds))

    def break_landing(self, thread: str) -> None:
        """Let a thread of the landing node raise an exception."""
        self._defect.publish(String(data=thread))

    def engage_without_waiting(self) -> None:
        """Call the landing node's service; nobody waits for the answer."""
        self._engage.call_async(Trigger.Request())

    def add_publisher(self, topic: str) -> Any:
        """Return one more publisher of a relayed topic."""
        kind, _, out = _RELAYED[topic]
        return self.node.create_publisher(kind, topic, out)

    def remove_publisher(self, publisher: Any) -> None:
        """End a publisher that was added."""
        self.node.destroy_publisher(publisher)

    def fail_model(self, fault: str) -> None:
        """Tell the segmentation node how its model has to fail; empty: not at all."""
        self._model.publish(String(data=fault))

    def _relay(self, name: str) -> Any:
        def take(message: Any) -> None:
            with self.lock:
                if name == HEATMAP:
                    self.heatmaps_s.append(time.monotonic())
                for delay_s, each in self._tampers[name](message):
                    if delay_s <= 0.0:
                        self._hand_on(name, each)
                        continue
                    self._count += 1
                    item = (time.monotonic() + delay_s, self._count, name, each)
                    heapq.heappush(self._queue, item)

        return take

    def _hand_on(self, name: str, message: Any) -> None:
        if name == HEATMAP:
            self.heatmaps += 1
        if name == IMAGE and self.clock_step_ns:
            # The camera's driver takes its stamps from the clock that was stepped.
            at_ns = ns_from_time(message.header.stamp) + self.clock_step_ns
            message.header.stamp = time_from_ns(at_ns)
        self._out[name].publish(message)

    def _release(self) -> None:
        with self.lock:
            self.turns_s.append(time.monotonic())
            while self._queue and self._queue[0][0] <= time.monotonic():
                _, _, name, message = heapq.heappop(self._queue)
                self._hand_on(name, message)

    def _on_clock(self, message: Clock) -> None:
        at_ns = ns_from_time(message.clock) + self.clock_step_ns
        self._clock_out.publish(Clock(clock=time_from_ns(at_ns)))

    def _on_status(self, message: DiagnosticArray, info: dict[str, int]) -> None:
        values = diagnostic_values(message)
        with self.lock:
            at_s = self._published_s(info)
            if at_s < self._since_s:
                return  # of the landing node before this one
            self.values = values
            self.said.append(Said(at_s, values.get('state', ''), values.get('reason', '')))
            self.lock.notify_all()

    def _on_pose(self, message: PoseStamped, info: dict[str, int]) -> None:
        pose = pose_from_message(message)
        with self.lock:
            self.truths.append(
                TruthSample(
                    self._published_s(info),
                    pose.north_m,
                    pose.east_m,
                    pose.altitude_agl_m,
                    pose.stamp_ns,
                )
            )
            self._poses[pose.stamp_ns] = pose
            while len(self._poses) > _KEPT_POSES:
                self._poses.popitem(last=False)
            self.lock.notify_all()

    def _published_s(self, info: dict[str, int]) -> float:
        """Return when DDS was given a message (it stamps in wall time), on the steady clock."""
        return info['source_timestamp'] * 1e-9 - self._epoch_s
