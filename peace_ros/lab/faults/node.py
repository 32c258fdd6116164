# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The matrix's own node: it hears the landing, and stands between the other nodes as a relay."""

from __future__ import annotations

import heapq
import threading
import time
from collections import OrderedDict
from typing import Any

import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PoseStamped
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.node import Node
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import Image
from std_msgs.msg import Float64, String
from std_srvs.srv import Trigger

from peace_ros.core.domain import Pose, VehicleError
from peace_ros.lab.faults.record import Said, TruthSample
from peace_ros.lab.faults.tamper import Tamper, untouched
from peace_ros.nodes import qos
from peace_ros.nodes.messages import (
    diagnostic_values,
    ns_from_time,
    pose_from_message,
    time_from_ns,
)

IMAGE, HEATMAP, PROMPT = 'image', 'heatmap', 'prompt'
RAW = 'raw/'
"""Before the name of a topic: what the real publisher says, which only the relay hears."""
_RELAYED: dict[str, tuple[Any, Any, Any]] = {
    IMAGE: (Image, qos.IMAGE_IN, qos.IMAGE_OUT),
    HEATMAP: (Image, qos.IMAGE_IN, qos.IMAGE_OUT),
    PROMPT: (DiagnosticArray, qos.RESULT, qos.RESULT),
}
_KEPT_POSES = 6000
"""Two minutes of ground truth."""
_NEAR_NS = 300_000_000
_RELEASE_S = 0.01
_JOIN_S = 5.0


class BenchNode:
    """Spins in a thread of its own; the lists are read under :attr:`lock`."""

    def __init__(self) -> None:
        self.lock = threading.RLock()
        self.said: list[Said] = []
        """``landing/status`` by the steady clock."""
        self.values: dict[str, str] = {}
        """Pairs of the newest status."""
        self.truths: list[TruthSample] = []
        self.heatmaps = 0
        """Heatmaps that were handed on since the last :meth:`forget`."""
        self.clock_step_ns = 0
        """Added to ``/clock``."""
        self._tampers: dict[str, Tamper] = dict.fromkeys(_RELAYED, untouched)
        self._poses: OrderedDict[int, Pose] = OrderedDict()
        self._heard_s: OrderedDict[int, float] = OrderedDict()
        self._queue: list[tuple[float, int, str, Any]] = []
        self._count = 0
        self._failure: Exception | None = None
        rclpy.init(args=[], signal_handler_options=rclpy.signals.SignalHandlerOptions.NO)
        self._node = Node('fault_bench')
        self._out = {
            name: self._node.create_publisher(kind, name, out)
            for name, (kind, _, out) in _RELAYED.items()
        }
        for name, (kind, into, _) in _RELAYED.items():
            self._node.create_subscription(kind, RAW + name, self._relay(name), into)
        self._clock_out = self._node.create_publisher(Clock, '/clock', qos.CLOCK)
        self._node.create_subscription(Clock, RAW + 'clock', self._on_clock, qos.CLOCK)
        self._node.create_subscription(
            DiagnosticArray, 'landing/status', self._on_status, qos.RESULT
        )
        self._node.create_subscription(PoseStamped, 'ground_truth/pose', self._on_pose, qos.POSE)
        self._stall = self._node.create_publisher(Float64, 'fault/stall', qos.RESULT)
        self._defect = self._node.create_publisher(String, 'fault/defect', qos.RESULT)
        self._model = self._node.create_publisher(String, 'fault/model', qos.RESULT)
        self._engage = self._node.create_client(Trigger, 'landing/engage')
        self._node.create_timer(_RELEASE_S, self._release)
        self._executor = SingleThreadedExecutor()
        self._executor.add_node(self._node)
        self._thread = threading.Thread(target=self._spin, name='fault_bench', daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Stop listening."""
        self._executor.shutdown()
        rclpy.try_shutdown()
        self._thread.join(timeout=_JOIN_S)

    def check(self) -> None:
        """Raise what ended the thread, if anything did."""
        if self._failure is not None:
            raise self._failure

    def forget(self) -> None:
        """Forget what was heard, and hand everything on again."""
        with self.lock:
            self.said.clear()
            self.values = {}
            self.truths.clear()
            self.heatmaps = 0
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
        """Return the true pose that was heard next to a moment of the steady clock."""
        with self.lock:
            heard = list(self._heard_s.items())
            if not heard:
                return None
            stamp_ns, _ = min(heard, key=lambda item: abs(item[1] - at_s))
            return self._poses.get(stamp_ns)

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

    def ask_to_engage(self) -> None:
        """Call the landing node's service; nobody waits for the answer."""
        self._engage.call_async(Trigger.Request())

    def fail_model(self, fault: str) -> None:
        """Tell the segmentation node what its model shall do; empty: work."""
        self._model.publish(String(data=fault))

    def model_listens(self) -> bool:
        """Whether a segmentation node hears :meth:`fail_model`."""
        return bool(self._model.get_subscription_count())

    def engage(self, limit_s: float) -> str:
        """Call the landing node's service; return why it refuses, empty when it began.

        Raises:
            VehicleError: it does not answer in time.
        """
        deadline = time.monotonic() + limit_s
        if not self._engage.wait_for_service(timeout_sec=limit_s):
            raise VehicleError(f'service landing/engage did not appear within {limit_s:g} s')
        future = self._engage.call_async(Trigger.Request())
        while not future.done():
            if time.monotonic() > deadline:
                raise VehicleError(f'service landing/engage did not answer within {limit_s:g} s')
            time.sleep(0.005)
        answer = future.result()
        if answer is None:
            raise VehicleError('service landing/engage gave no answer')
        return '' if answer.success else str(answer.message) or 'without a reason'

    def _spin(self) -> None:
        try:
            self._executor.spin()
        except ExternalShutdownException:
            return
        except Exception as error:
            # Without this thread everything would look as if it stood still.
            self._failure = error

    def _relay(self, name: str) -> Any:
        def take(message: Any) -> None:
            with self.lock:
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
            while self._queue and self._queue[0][0] <= time.monotonic():
                _, _, name, message = heapq.heappop(self._queue)
                self._hand_on(name, message)

    def _on_clock(self, message: Clock) -> None:
        at_ns = ns_from_time(message.clock) + self.clock_step_ns
        self._clock_out.publish(Clock(clock=time_from_ns(at_ns)))

    def _on_status(self, message: DiagnosticArray) -> None:
        values = diagnostic_values(message)
        at_s = time.monotonic()
        with self.lock:
            self.values = values
            self.said.append(Said(at_s, values.get('state', ''), values.get('reason', '')))

    def _on_pose(self, message: PoseStamped) -> None:
        pose = pose_from_message(message)
        at_s = time.monotonic()
        with self.lock:
            self.truths.append(TruthSample(at_s, pose.north_m, pose.east_m, pose.altitude_agl_m))
            self._poses[pose.stamp_ns] = pose
            self._heard_s[pose.stamp_ns] = at_s
            while len(self._poses) > _KEPT_POSES:
                self._poses.popitem(last=False)
                self._heard_s.popitem(last=False)
