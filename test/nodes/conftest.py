# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""ROS in the test process: a domain of its own, peers that collect, waiting on predicates."""

from __future__ import annotations

import os
import threading
import time
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pytest
import rclpy
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from geometry_msgs.msg import PoseStamped
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.parameter import Parameter
from sensor_msgs.msg import CameraInfo, Image

from peace_ros.core.domain import Camera, Heatmap, Pose
from peace_ros.core.vehicle import VehicleParameters, open_vehicle
from peace_ros.nodes import qos
from peace_ros.nodes.images import FRAME_INFO
from peace_ros.nodes.messages import camera_info, heatmap_to_image, image_message, pose_to_message
from peace_ros.nodes.node import PeaceNode
from peace_ros.simulation.demo.pilot import Pilot

os.environ['ROS_AUTOMATIC_DISCOVERY_RANGE'] = 'LOCALHOST'
os.environ['ROS_DOMAIN_ID'] = str(1 + os.getpid() % 100)

WAIT_S = 20.0


@pytest.fixture(scope='session', autouse=True)
def ros() -> Iterator[None]:
    if rclpy.ok():  # the tests of the simulators' nodes share this bench
        yield
        return
    rclpy.init(args=[], signal_handler_options=rclpy.signals.SignalHandlerOptions.NO)
    yield
    rclpy.try_shutdown()


class Heatmaps:
    """Publishes heatmaps as segmentation does, with what took their frames."""

    def __init__(self, heatmaps: Any, frame_infos: Any) -> None:
        self.heatmaps = heatmaps
        self.frame_infos = frame_infos
        self.frame_size_px: tuple[int, int] | None = (352, 352)
        """None: nothing says what took the frames."""
        self.camera: Camera | None = None

    def publish(self, safety: np.ndarray, at_ns: int) -> None:
        if self.frame_size_px is not None:
            self.frame_infos.publish(camera_info(self.frame_size_px, self.camera, at_ns, 'optical'))
        self.heatmaps.publish(heatmap_to_image(Heatmap(safety, at_ns)))


class Bench:
    """Spins the node under test and a peer; what comes on topics is kept in lists."""

    def __init__(self) -> None:
        self.peer = Node('peer')
        self._executors = []
        self._threads = []
        self._nodes: list[PeaceNode] = []
        self.spin(self.peer)

    def spin(self, node: Any) -> None:
        executor = SingleThreadedExecutor()
        executor.add_node(node)
        thread = threading.Thread(target=executor.spin, daemon=True)
        thread.start()
        self._executors.append(executor)
        self._threads.append(thread)

    def run(self, create: Callable[..., PeaceNode], *given: Any, **parameters: Any) -> PeaceNode:
        node = create(*given, parameter_overrides=overrides(**parameters))
        self._nodes.append(node)
        self.spin(node)
        return node

    def heard(self, kind: Any, topic: str, profile: Any) -> list[Any]:
        messages: list[Any] = []

        def keep(message: Any) -> None:
            messages.append(message)

        self.peer.create_subscription(kind, topic, keep, profile)
        return messages

    def findings(self, task: str) -> list[DiagnosticStatus]:
        """Return a list that gets what /diagnostics says of a task that had work."""
        found: list[DiagnosticStatus] = []

        def keep(message: DiagnosticArray) -> None:
            found.extend(
                each
                for each in message.status
                if each.name.endswith(f': {task}') and 'nothing to do' not in each.message
            )

        self.peer.create_subscription(DiagnosticArray, '/diagnostics', keep, qos.RESULT)
        return found

    def offer(self, kind: Any, topic: str, profile: Any) -> Any:
        """Return a publisher once the node under test listens."""
        publisher = self.peer.create_publisher(kind, topic, profile)
        self.until(lambda: publisher.get_subscription_count() > 0)
        return publisher

    def offer_heatmaps(self, namespace: str = '') -> Heatmaps:
        """Return a publisher of heatmaps once the landing node listens."""
        return Heatmaps(
            self.offer(Image, f'{namespace}/heatmap'.lstrip('/'), qos.IMAGE_OUT),
            self.offer(CameraInfo, f'{namespace}/{FRAME_INFO}'.lstrip('/'), qos.RESULT),
        )

    def offer_safe_ground(
        self, node: PeaceNode, altitude_m: float, north_m: float = 0.0, east_m: float = 0.0
    ) -> Callable[[], None]:
        """Return what publishes a level pose and a heatmap that is safe everywhere, as of now."""
        heatmaps = self.offer_heatmaps()
        poses = self.offer(PoseStamped, 'pose', qos.POSE)
        safety = np.full((32, 32), 0.97, np.float32)

        def see() -> None:
            at_ns = node.clock_ns()
            level = (1.0, 0.0, 0.0, 0.0)
            pose = Pose(at_ns, north_m, east_m, -altitude_m, level, altitude_m)
            poses.publish(pose_to_message(pose))
            heatmaps.publish(safety, at_ns)

        return see

    def until(
        self,
        predicate: Callable[[], bool],
        doing: Callable[[], None] | None = None,
        *,
        within_s: float = WAIT_S,
    ) -> None:
        """Wait for a predicate; ``doing`` is repeated at 20 Hz meanwhile."""
        deadline = time.monotonic() + within_s
        while not predicate():
            assert time.monotonic() < deadline, 'did not happen in time'
            for node in self._nodes:
                if node.failure is not None:
                    raise node.failure
            if doing is not None:
                doing()
            time.sleep(0.05 if doing is not None else 0.005)

    def close(self) -> None:
        for executor, thread in zip(self._executors, self._threads, strict=True):
            executor.shutdown()
            thread.join(5.0)
        for node in self._nodes:
            node.close()
            node.destroy_node()
        self.peer.destroy_node()


def overrides(**parameters: Any) -> list[Any]:
    return [Parameter(name.replace('__', '.'), value=value) for name, value in parameters.items()]


@pytest.fixture
def bench() -> Iterator[Bench]:
    bench = Bench()
    yield bench
    bench.close()


@pytest.fixture
def picture() -> Callable[[int], Any]:
    def make(at_ns: int, width: int = 64, height: int = 48) -> Any:
        pixels = np.zeros((height, width, 3), np.uint8)
        pixels[..., 1] = 120
        pixels[: height // 2] += 30  # a picture of one colour is refused
        return image_message(pixels, 'rgb8', at_ns)

    return make


@pytest.fixture
def values_of() -> Callable[[DiagnosticArray | DiagnosticStatus], dict[str, str]]:
    def values(message: DiagnosticArray | DiagnosticStatus) -> dict[str, str]:
        status = message.status[0] if isinstance(message, DiagnosticArray) else message
        return {each.key: each.value for each in status.values}

    return values


@pytest.fixture
def take_off() -> Callable[[str, float], None]:
    """Bring the vehicle of a URL into the air, and leave the line."""

    def climb(url: str, altitude_m: float) -> None:
        link = open_vehicle(url, parameters=VehicleParameters(system_id=250))
        try:
            Pilot(link).take_off(altitude_m, timeout_s=20.0, arm=True)
        finally:
            link.close()

    return climb
