# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The watch node: standard topics -> the ledger of the page; the page's commands -> services.

While nobody looks it takes small messages only. Nothing that flies waits for it.
"""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Sequence
from concurrent.futures import Future
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PoseStamped
from nav_msgs.msg import OccupancyGrid
from rclpy.clock import Clock, ClockType
from rclpy.parameter import parameter_value_to_python
from rclpy.parameter_client import AsyncParameterClient
from sensor_msgs.msg import CameraInfo, CompressedImage
from std_srvs.srv import Trigger

from peace_ros.core.domain import Camera, ConfigurationError, PeaceError
from peace_ros.core.health import too_many
from peace_ros.core.messages import (
    camera_from_info,
    diagnostic_values,
    pose_from_message,
    stamp_ns_of,
)
from peace_ros.nodes.node import PeaceNode
from peace_ros.nodes.qos import IMAGE_IN, LATCHED, POSE_IN, RESULT
from peace_ros.nodes.runtime import run
from peace_ros.watch.ledger import Ledger, Picture, TaskReport
from peace_ros.watch.marks import camera_of, marks, mount_of, pose_at
from peace_ros.watch.options import WATCH, WatchOptions
from peace_ros.watch.server import PageServer
from peace_ros.watch.tickets import ACTIONS

_STATUS = 'landing/status'
_TURN_S = 0.2
_GRAPH_S = 2.0
_INFOS = 10
"""Kept until the overlays of their frames arrive."""
_MOST_CELLS = 4_000_000
_PARAMETERS = (
    *('camera_width', 'camera_height', 'camera_fov', 'mount_source'),
    'vehicle.follow_gimbal',
    *('mount_roll', 'mount_pitch', 'mount_yaw', 'mount_x', 'mount_y', 'mount_z'),
    *('safe_altitude_m', 'handover_altitude_m', 'lateral_speed_limit', 'z_speed_landing'),
    *('landing_lateral_speed_limit', 'z_speed_climbing', 'geofence_radius_m', 'search_radius_m'),
    *('safety_threshold', 'safety_radius_m', 'max_total_s'),
)
"""Of the landing node: limits to show, and what places marks in the picture."""


class WatchNode(PeaceNode):
    """Listens, and serves the page."""

    def __init__(self, **options: Any) -> None:
        """Subscribe, and open the port.

        Raises:
            PeaceError: parameters cannot be used, or the port is taken.
        """
        super().__init__('watch', *WATCH, **options)
        chosen = self.filled(WatchOptions)
        self.ledger = Ledger(self.get_namespace())
        self._heavy: list[Any] = []
        self._infos: dict[int, CameraInfo] = {}
        self._pictures = 0
        self._graph_due_s = 0.0
        self._commands = {name: self.create_client(Trigger, f'landing/{name}') for name in ACTIONS}
        self._landing = AsyncParameterClient(self, 'landing')
        self.create_subscription(DiagnosticArray, _STATUS, self._on_status, RESULT)
        self.create_subscription(DiagnosticArray, 'prompt', self._on_prompt, RESULT)
        self.create_subscription(DiagnosticArray, '/diagnostics', self._on_findings, RESULT)
        self._page = PageServer(
            self.ledger,
            self.command,
            port=chosen.port,
            viewers=chosen.viewers,
            on_defect=self.fail,
        )
        self.url, self.port = self._page.url, self._page.port
        self.origin = self.url.partition('/#')[0]
        self.create_timer(_TURN_S, self._turn, clock=Clock(clock_type=ClockType.STEADY_TIME))
        if chosen.url_file:
            _write_for_owner(Path(chosen.url_file), self.url)
        print(f'open {self.url}', flush=True)

    def close(self) -> None:
        """Close the page."""
        self._page.close()

    def has_frame_info(self, stamp_ns: int) -> bool:
        """Tell whether the camera of the frame of a stamp is known."""
        return stamp_ns in self._infos

    def command(self, action: str) -> Future[tuple[bool, str]]:
        """Ask the landing node to engage or disengage; from any thread."""
        answer: Future[tuple[bool, str]] = Future()
        client = self._commands[action]
        if not client.service_is_ready():
            missing = f'{client.srv_name} is not there: does the landing node run?'
            answer.set_result((False, missing))
            return answer

        def take(asked: Any) -> None:
            # Cancelled by the page when the answer took too long.
            if answer.set_running_or_notify_cancel():
                result = asked.result()
                answer.set_result((bool(result.success), str(result.message)))

        client.call_async(Trigger.Request()).add_done_callback(take)
        return answer

    def _turn(self) -> None:
        """Take pictures while somebody looks, and look at the graph now and then."""
        is_watched = self._page.viewers > 0
        if is_watched and not self._heavy:
            self._heavy = [
                self.create_subscription(
                    CompressedImage, 'overlay/compressed', self._on_overlay, IMAGE_IN
                ),
                self.create_subscription(
                    CameraInfo, 'heatmap/frame_info', self._on_frame_info, RESULT
                ),
                self.create_subscription(PoseStamped, 'landing/pose', self._on_pose, POSE_IN),
                self.create_subscription(OccupancyGrid, 'landing/map', self._on_map, LATCHED),
            ]
        elif not is_watched and self._heavy:
            for each in self._heavy:
                self.destroy_subscription(each)
            self._heavy = []
        now_s = time.monotonic()
        if is_watched and now_s >= self._graph_due_s:
            self._graph_due_s = now_s + _GRAPH_S
            self._look_at_graph()

    def _look_at_graph(self) -> None:
        own = self.resolve_topic_name(_STATUS)
        sources = self.count_publishers(own)
        problem = too_many(own, sources) if sources > 1 else ''
        others = sorted(
            name.removesuffix(f'/{_STATUS}') or '/'
            for name, _ in self.get_topic_names_and_types()
            if name.endswith(f'/{_STATUS}') and name != own and self.count_publishers(name)
        )
        with self.ledger.lock:
            self.ledger.problem = problem
            self.ledger.others = others
        # Asked again each time: the node may have been started anew, or a parameter is live.
        if self._landing.services_are_ready():
            self._landing.get_parameters(list(_PARAMETERS), self._on_parameters)

    def _on_parameters(self, asked: Any) -> None:
        values = [parameter_value_to_python(each) for each in asked.result().values]
        known = dict(zip(_PARAMETERS, values, strict=False))
        with self.ledger.lock:
            self.ledger.parameters = {
                name: value for name, value in known.items() if value is not None
            }

    def _on_status(self, message: DiagnosticArray) -> None:
        level = int.from_bytes(message.status[0].level, 'little') if message.status else 0
        self.ledger.hear_status(diagnostic_values(message), level, time.monotonic())
        self._page.news()

    def _on_prompt(self, message: DiagnosticArray) -> None:
        try:
            self.ledger.hear_prompt(
                diagnostic_values(message), stamp_ns_of(message), time.monotonic()
            )
        except ConfigurationError as error:
            self.say('prompt', str(error))

    def _on_findings(self, message: DiagnosticArray) -> None:
        now_s = time.monotonic()
        own = self.get_namespace().strip('/')
        self.ledger.hear_findings(
            [
                TaskReport(
                    each.name,
                    int.from_bytes(each.level, 'little'),
                    each.message,
                    {pair.key: pair.value for pair in each.values},
                    now_s,
                )
                for each in message.status
                if ': ' in each.name and each.name.split(': ')[0].rpartition('/')[0] == own
            ]
        )

    def _on_pose(self, message: PoseStamped) -> None:
        try:
            self.ledger.hear_pose(pose_from_message(message))
        except PeaceError as error:
            self.say('pose', str(error))

    def _on_frame_info(self, message: CameraInfo) -> None:
        self._infos[stamp_ns_of(message)] = message
        while len(self._infos) > _INFOS:
            del self._infos[next(iter(self._infos))]

    def _on_overlay(self, message: CompressedImage) -> None:
        stamp_ns = stamp_ns_of(message)
        self._pictures += 1
        meta = {'marks': self._marks(stamp_ns)}
        data = bytes(message.data)
        self.ledger.overlay = Picture(self._pictures, data, time.monotonic(), meta)
        self._page.news()

    def _marks(self, stamp_ns: int) -> list[dict[str, Any]]:
        """Return the places in the picture of a stamp; none while anything for it is missing."""
        with self.ledger.lock:
            parameters, pose = self.ledger.parameters, pose_at(self.ledger.poses, stamp_ns)
        mount, info = mount_of(parameters), self._infos.get(stamp_ns)
        if mount is None or pose is None or info is None:
            return []
        try:
            camera = _camera(info) or camera_of(parameters)
        except PeaceError as error:
            self.say('frame_info', str(error))
            return []
        return [] if camera is None else marks(self.ledger.circles(), camera, mount, pose)

    def _on_map(self, message: OccupancyGrid) -> None:
        rows, columns = message.info.height, message.info.width
        if not 0 < rows * columns == len(message.data) <= _MOST_CELLS:
            self.say('map', f'a map of {columns} x {rows} cells with {len(message.data)} values')
            return
        self._pictures += 1
        origin = message.info.origin.position
        cell_m = message.info.resolution
        meta = {
            'west_m': origin.x,
            'south_m': origin.y,
            'width_m': columns * cell_m,
            'height_m': rows * cell_m,
        }
        cells = np.frombuffer(message.data, np.int8)
        png = map_png(cells.reshape(rows, columns))
        self.ledger.ground = Picture(self._pictures, png, time.monotonic(), meta)
        self._page.news()


def _camera(info: CameraInfo) -> Camera | None:
    """Return the camera of the frame of a heatmap; its K is always that of the frame."""
    return camera_from_info(info, (info.width, info.height), rectified=False)


_RAMP_BGR = np.array([[60, 170, 70], [120, 190, 190], [50, 60, 200]], np.float32)
"""Safe, doubtful, unsafe."""


def _palette() -> np.ndarray[Any, np.dtype[np.uint8]]:
    """Return BGRA of each cell value as uint8: 0 safe to 100 unsafe, others (-1) are clear."""
    value = np.arange(256)
    colours = np.zeros((256, 4), np.uint8)
    for channel in range(3):
        colours[:, channel] = np.interp(value, [0, 50, 100], _RAMP_BGR[:, channel])
    colours[:101, 3] = 255
    return colours


_PALETTE = _palette()


def map_png(cells: np.ndarray[Any, np.dtype[np.int8]]) -> bytes:
    """Return a PNG of the cells of a nav_msgs/OccupancyGrid, north up, unknown ground clear."""
    picture = _PALETTE[np.flipud(cells).view(np.uint8)]
    done, data = cv2.imencode('.png', picture, [cv2.IMWRITE_PNG_COMPRESSION, 1])
    if not done:
        raise ConfigurationError('the map cannot be written as PNG')
    return bytes(data)


def _write_for_owner(path: Path, text: str) -> None:
    """Write a file that nobody else on this machine can read.

    Raises:
        ConfigurationError: it cannot be written.
    """
    try:
        path.unlink(missing_ok=True)
        handle = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600)
    except OSError as error:
        raise ConfigurationError(f'url_file {path} cannot be written: {error}') from error
    with os.fdopen(handle, 'w', encoding='utf-8') as file:
        file.write(f'{text}\n')


def main(args: Sequence[str] | None = None) -> int:
    """Run the node until SIGINT or SIGTERM."""
    return run(WatchNode, args)


if __name__ == '__main__':
    sys.exit(main())
