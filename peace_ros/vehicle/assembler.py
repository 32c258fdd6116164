# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""From the autopilot's messages to Telemetry and Poses; pure, with the clocks handed in."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from math import isfinite, sqrt
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from peace_ros.domain.geometry import Quaternion, quaternion_from_euler
from peace_ros.domain.motion import Pose, Telemetry
from peace_ros.vehicle.dialects import Dialect
from peace_ros.vehicle.parameters import VehicleParameters

MAX_EXTRAPOLATION_S = 0.3
RANGE_LIMIT_S = 0.5
REBOOT_MS = 1000
"""A boot time that goes back by more than this is a reboot."""
MAX_POSES = 256
MAX_TEXTS = 50
CHUNK = 50


@dataclass(frozen=True)
class _Position:
    steady_ns: int
    boot_ms: int
    north_m: float
    east_m: float
    down_m: float
    v_m_s: tuple[float, float, float]


class Assembler:
    """Keeps the newest of every part; values that are no numbers are counted, never used."""

    def __init__(self, dialect: Dialect, parameters: VehicleParameters) -> None:
        self._dialect = dialect
        self._parameters = parameters
        self.poses: deque[Pose] = deque(maxlen=MAX_POSES)
        self.texts: deque[tuple[int, str]] = deque(maxlen=MAX_TEXTS)
        """(steady clock ns, STATUSTEXT)."""
        self.rejected = 0
        """Messages with numbers that are none, or attitudes that are no rotation."""
        self.reboots = 0
        self.arrived_ns: dict[int, int] = {}
        """Message id -> steady clock of the newest."""
        self.landed_state = 0
        """MAV_LANDED_STATE; 0 while it is not known."""
        self._received_ns = 0
        self._forget()
        self._chunks: dict[int, str] = {}

    def _forget(self) -> None:
        self._position: _Position | None = None
        self._pose: Pose | None = None
        self._pose_ns = 0
        self._home_down_m = 0.0
        self._range: tuple[int, float] | None = None
        self._boot_ms = 0
        self._mode = ''
        self._armed = False
        self._heartbeat_ns: int | None = None
        self.landed_state = 0
        self.arrived_ns.clear()

    def take(self, message: Any, stamp_ns: int, steady_ns: int) -> None:
        """Take one message of the believed autopilot.

        Args:
            message: A pymavlink message.
            stamp_ns: Node clock at receipt; poses get it.
            steady_ns: Steady clock at receipt.
        """
        self._received_ns = steady_ns
        handler = _HANDLERS.get(message.get_type())
        if handler is not None:
            boot_ms = getattr(message, 'time_boot_ms', None)
            if boot_ms is not None:
                self._watch_boot(boot_ms)
            if handler(self, message, stamp_ns, steady_ns):
                self.arrived_ns[message.get_msgId()] = steady_ns
            else:
                self.rejected += 1

    @property
    def mode(self) -> str:
        """Name of the newest mode, empty before the first HEARTBEAT."""
        return self._mode

    @property
    def armed(self) -> bool:
        """The armed bit of the newest HEARTBEAT."""
        return self._armed

    def telemetry(self, steady_ns: int) -> Telemetry:
        """Return what is known now; a pose that is too old is None."""
        p = self._parameters
        pose = self._pose
        if pose is not None and steady_ns - self._pose_ns > p.pose_limit_s * 1e9:
            pose = None
        velocity = self._position.v_m_s if self._position and pose else (0.0, 0.0, 0.0)
        heard = (
            self._heartbeat_ns is not None
            and steady_ns - self._heartbeat_ns <= p.heartbeat_limit_s * 1e9
        )
        state = self.landed_state
        return Telemetry(
            received_ns=self._received_ns,
            pose=pose,
            v_north_m_s=velocity[0],
            v_east_m_s=velocity[1],
            v_down_m_s=velocity[2],
            armed=self._armed,
            in_control=heard and self._mode == self._dialect.control_mode,
            mode=self._mode,
            landed=None if state == 0 else state == mavlink.MAV_LANDED_STATE_ON_GROUND,
            status_text=self.texts[-1][1] if self.texts else '',
        )

    def _watch_boot(self, boot_ms: int) -> None:
        if boot_ms + REBOOT_MS < self._boot_ms:
            self.reboots += 1
            mode, armed, heard = self._mode, self._armed, self._heartbeat_ns
            self._forget()
            self._mode, self._armed, self._heartbeat_ns = mode, armed, heard
        self._boot_ms = max(self._boot_ms, boot_ms)

    def _heartbeat(self, m: Any, _stamp_ns: int, steady_ns: int) -> bool:
        self._mode = self._dialect.mode_name(m.custom_mode)
        self._armed = bool(m.base_mode & mavlink.MAV_MODE_FLAG_SAFETY_ARMED)
        self._heartbeat_ns = steady_ns
        return True

    def _local_position(self, m: Any, _stamp_ns: int, steady_ns: int) -> bool:
        if not all(isfinite(each) for each in (m.x, m.y, m.z, m.vx, m.vy, m.vz)):
            return False
        self._position = _Position(steady_ns, m.time_boot_ms, m.x, m.y, m.z, (m.vx, m.vy, m.vz))
        return True

    def _euler(self, m: Any, stamp_ns: int, steady_ns: int) -> bool:
        if not all(isfinite(each) for each in (m.roll, m.pitch, m.yaw)):
            return False
        self._make_pose(
            quaternion_from_euler(m.roll, m.pitch, m.yaw), m.time_boot_ms, stamp_ns, steady_ns
        )
        return True

    def _quaternion(self, m: Any, stamp_ns: int, steady_ns: int) -> bool:
        q = (m.q1, m.q2, m.q3, m.q4)
        size = sqrt(sum(each * each for each in q))
        if not 0.9 < size < 1.1:
            return False
        unit = (q[0] / size, q[1] / size, q[2] / size, q[3] / size)
        self._make_pose(unit, m.time_boot_ms, stamp_ns, steady_ns)
        return True

    def _make_pose(self, q: Quaternion, boot_ms: int, stamp_ns: int, steady_ns: int) -> None:
        """Bring the newest position to the moment of the attitude, by its velocity."""
        at = self._position
        if at is None or steady_ns - at.steady_ns > self._parameters.pose_limit_s * 1e9:
            return
        dt = (boot_ms - at.boot_ms) / 1000.0
        dt = max(-MAX_EXTRAPOLATION_S, min(MAX_EXTRAPOLATION_S, dt))
        down = at.down_m + dt * at.v_m_s[2]
        self._pose = Pose(
            stamp_ns=stamp_ns,
            north_m=at.north_m + dt * at.v_m_s[0],
            east_m=at.east_m + dt * at.v_m_s[1],
            down_m=down,
            quaternion_ned_frd=q,
            altitude_agl_m=self._altitude_m(down, q, steady_ns),
        )
        self._pose_ns = steady_ns
        self.poses.append(self._pose)

    def _altitude_m(self, down_m: float, q: Quaternion, steady_ns: int) -> float:
        above_home = self._home_down_m - down_m
        if self._parameters.altitude_source != 'rangefinder' or self._range is None:
            return above_home
        seen_ns, distance_m = self._range
        if steady_ns - seen_ns > RANGE_LIMIT_S * 1e9:
            return above_home
        return distance_m * max(0.0, 1.0 - 2.0 * (q[1] ** 2 + q[2] ** 2))

    def _distance(self, m: Any, _stamp_ns: int, steady_ns: int) -> bool:
        if m.orientation != mavlink.MAV_SENSOR_ROTATION_PITCH_270:
            return True
        in_range = m.min_distance < m.current_distance < m.max_distance
        self._range = (steady_ns, m.current_distance / 100.0) if in_range else None
        return True

    def _home(self, m: Any, _stamp_ns: int, _steady_ns: int) -> bool:
        if not isfinite(m.z):
            return False
        self._home_down_m = m.z
        return True

    def _landed(self, m: Any, _stamp_ns: int, _steady_ns: int) -> bool:
        self.landed_state = m.landed_state
        return True

    def _text(self, m: Any, _stamp_ns: int, steady_ns: int) -> bool:
        text = m.text if isinstance(m.text, str) else m.text.decode('utf-8', 'replace')
        text = text.rstrip('\0')
        if m.id:
            if len(self._chunks) > 8:
                self._chunks.clear()
            whole = self._chunks.pop(m.id, '') + text
            if len(text) >= CHUNK and len(whole) < 1024:
                self._chunks[m.id] = whole
                return True
            text = whole
        self.texts.append((steady_ns, text))
        return True


_HANDLERS = {
    'HEARTBEAT': Assembler._heartbeat,  # noqa: SLF001
    'LOCAL_POSITION_NED': Assembler._local_position,  # noqa: SLF001
    'ATTITUDE': Assembler._euler,  # noqa: SLF001
    'ATTITUDE_QUATERNION': Assembler._quaternion,  # noqa: SLF001
    'DISTANCE_SENSOR': Assembler._distance,  # noqa: SLF001
    'HOME_POSITION': Assembler._home,  # noqa: SLF001
    'EXTENDED_SYS_STATE': Assembler._landed,  # noqa: SLF001
    'STATUSTEXT': Assembler._text,  # noqa: SLF001
}
