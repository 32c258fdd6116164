# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""From the autopilot's messages to Telemetry and Poses; pure, with the clocks handed in."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from math import isfinite, nan, sqrt
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from peace_ros.core.domain.geometry import Quaternion, quaternion_from_euler, yaw_from_quaternion
from peace_ros.core.domain.motion import Pose, Telemetry
from peace_ros.core.vehicle.clock import TimeMap
from peace_ros.core.vehicle.dialects import Dialect
from peace_ros.core.vehicle.heights import MAX_EXTRAPOLATION_S, Height, HomeHeight, height_of
from peace_ros.core.vehicle.parameters import VehicleParameters
from peace_ros.core.vehicle.texts import StatusTexts
from peace_ros.core.vehicle.trust import JumpWatch, PoseReport

RANGE_LIMIT_S = 0.5
REBOOT_MS = 1000
"""A boot time that goes back by more than this is a reboot."""
MAX_POSES = 256
ESTIMATOR_LIMIT_S = 3.0
"""Age at which the report of the position filter about itself is stale."""
KNOWS_POSITION = mavlink.ESTIMATOR_POS_HORIZ_REL | mavlink.ESTIMATOR_POS_HORIZ_ABS
GLOBAL_POSITION = mavlink.ESTIMATOR_POS_HORIZ_ABS
GUESSES_POSITION = mavlink.ESTIMATOR_CONST_POS_MODE
"""PX4 sets it for a vehicle at rest too, beside the bit of a global position, which it then has."""
IN_ORDER = frozenset({'LOCAL_POSITION_NED', 'ATTITUDE', 'ATTITUDE_QUATERNION'})
"""Of these only the newest is used, in whatever order they are received."""
NUMBERS = {
    'LOCAL_POSITION_NED': ('x', 'y', 'z', 'vx', 'vy', 'vz'),
    'ATTITUDE': ('roll', 'pitch', 'yaw'),
    'ATTITUDE_QUATERNION': ('q1', 'q2', 'q3', 'q4'),
    'HOME_POSITION': ('z',),
}
"""Fields that must be numbers."""


@dataclass(frozen=True)
class _Position:
    steady_ns: int
    report: PoseReport


class Assembler:
    """Keeps the newest of every part; values that are not numbers are counted, never used.

    Args:
        dialect: Of the autopilot.
        parameters: Limits, source of altitude.
        clock: The autopilot's clock in terms of ours; None: poses get the moment of receipt.
    """

    def __init__(
        self, dialect: Dialect, parameters: VehicleParameters, clock: TimeMap | None = None
    ) -> None:
        self._dialect = dialect
        self._parameters = parameters
        self._clock = clock or TimeMap()
        self._watch = JumpWatch(parameters.jump_limit_m)
        self.poses: deque[Pose] = deque(maxlen=MAX_POSES)
        self.texts = StatusTexts()
        self.rejected = 0
        """Messages with values that are not numbers, or with attitudes that are not rotations."""
        self.late = 0
        """Messages that were received twice, or after a newer one."""
        self.reboots = 0
        self.arrived_ns: dict[int, int] = {}
        """Message id -> steady clock of the newest."""
        self.landed_state = 0
        """MAV_LANDED_STATE; 0 while it is not known."""
        self._received_ns = 0
        self._battery: float | None = None
        self._mode = ''
        self._armed = False
        self._heartbeat_ns: int | None = None
        self._forget()

    def _forget(self) -> None:
        """Forget what a reboot invalidates; mode and armed stay valid until the next HEARTBEAT."""
        self._position: _Position | None = None
        self._pose: Pose | None = None
        self._pose_ns = 0
        self._yaw_rad = 0.0
        self._home = HomeHeight(is_local=self._dialect.home_is_local)
        self._height: Height | None = None
        self._range: tuple[int, float] | None = None
        self._boot_ms = 0
        self._newest_boot_ms: dict[str, int] = {}
        self._estimator: tuple[int, int] | None = None
        self.landed_state = 0
        self.arrived_ns.clear()
        self._watch.forget()
        self._clock.forget()

    def take(self, message: Any, stamp_ns: int, steady_ns: int) -> None:
        """Take one message of the believed autopilot.

        Args:
            message: A pymavlink message.
            stamp_ns: Node clock at receipt.
            steady_ns: Steady clock at receipt.
        """
        self._received_ns = steady_ns
        kind = message.get_type()
        handler = _HANDLERS.get(kind)
        if handler is None:
            return
        boot_ms = getattr(message, 'time_boot_ms', None)
        if boot_ms is not None:
            self._watch_boot(boot_ms)
        if not _is_sane(kind, message):
            self.rejected += 1
        elif kind in IN_ORDER and self._is_late(kind, message.time_boot_ms):
            self.late += 1
        else:
            handler(self, message, stamp_ns, steady_ns)
            self.arrived_ns[message.get_msgId()] = steady_ns

    @property
    def mode(self) -> str:
        """Name of the newest mode, empty before the first HEARTBEAT."""
        return self._mode

    @property
    def armed(self) -> bool:
        """The armed bit of the newest HEARTBEAT."""
        return self._armed

    @property
    def yaw_rad(self) -> float:
        """Newest heading, NED; it needs no position."""
        return self._yaw_rad

    @property
    def home_msl_m(self) -> float | None:
        """Altitude of home above sea level."""
        return self._home.home_msl_m

    @property
    def reported_ns(self) -> int:
        """The autopilot's clock of the newest believed position, 0 before the first."""
        return 0 if self._position is None else self._position.report.boot_ms * 1_000_000

    def heartbeat_age_s(self, steady_ns: int) -> float:
        """Return the time since the newest HEARTBEAT, infinite before the first."""
        if self._heartbeat_ns is None:
            return float('inf')
        return (steady_ns - self._heartbeat_ns) / 1e9

    def position_problem(self, steady_ns: int) -> str:
        """Return why there is no position to fly by, empty when nothing speaks against it."""
        flags = self._estimator_flags(steady_ns)
        guesses = flags is not None and flags & GUESSES_POSITION and not flags & GLOBAL_POSITION
        if flags is not None and (not flags & KNOWS_POSITION or guesses):
            return (
                f'the autopilot has no estimate of its position (filter flags 0x{flags:X}) and '
                'refuses velocity set-points: it needs GNSS, external navigation or optical flow'
            )
        return self._watch.problem

    def telemetry(self, steady_ns: int) -> Telemetry:
        """Return what is known now; a pose that is too old or rejected is None."""
        p = self._parameters
        pose, problem = self._pose, self._doubt(steady_ns)
        if pose is None or problem or steady_ns - self._pose_ns > p.pose_limit_s * 1e9:
            pose = None
        at = self._position
        velocity = at.report.velocity_m_s if at and pose else (0.0, 0.0, 0.0)
        state = self.landed_state
        return Telemetry(
            received_ns=self._received_ns,
            pose=pose,
            position_problem=problem,
            v_north_m_s=velocity[0],
            v_east_m_s=velocity[1],
            v_down_m_s=velocity[2],
            armed=self._armed,
            in_control=self._mode == self._dialect.control_mode,
            mode=self._mode,
            landed=None if state == 0 else state == mavlink.MAV_LANDED_STATE_ON_GROUND,
            status_text=self.texts.newest,
            battery_remaining=self._battery,
        )

    def _doubt(self, steady_ns: int) -> str:
        """Return why the reported position is rejected, empty when it is accepted."""
        problem = self.position_problem(steady_ns)
        limit_s, age_s = self._parameters.heartbeat_limit_s, self.heartbeat_age_s(steady_ns)
        if problem or self._heartbeat_ns is None or age_s <= limit_s:
            return problem
        return f'HEARTBEAT is {age_s:.1f} s old, limit {limit_s:g} s: it is unknown who controls it'

    def _estimator_flags(self, steady_ns: int) -> int | None:
        if self._estimator is None:
            return None
        seen_ns, flags = self._estimator
        return flags if steady_ns - seen_ns <= ESTIMATOR_LIMIT_S * 1e9 else None

    def _watch_boot(self, boot_ms: int) -> None:
        if boot_ms + REBOOT_MS < self._boot_ms:
            self.reboots += 1
            self._forget()
        self._boot_ms = max(self._boot_ms, boot_ms)

    def _is_late(self, kind: str, boot_ms: int) -> bool:
        newest_ms = self._newest_boot_ms.get(kind, -1)
        self._newest_boot_ms[kind] = max(newest_ms, boot_ms)
        return boot_ms <= newest_ms

    def _heartbeat(self, m: Any, _stamp_ns: int, steady_ns: int) -> None:
        self._mode = self._dialect.mode_name(m.custom_mode)
        self._armed = bool(m.base_mode & mavlink.MAV_MODE_FLAG_SAFETY_ARMED)
        self._heartbeat_ns = steady_ns

    def _local_position(self, m: Any, _stamp_ns: int, steady_ns: int) -> None:
        report = PoseReport(m.time_boot_ms, (m.x, m.y, m.z), (m.vx, m.vy, m.vz))
        in_control = self._armed and self._mode == self._dialect.control_mode
        if self._watch.believes(report, in_control=in_control):
            self._position = _Position(steady_ns, report)

    def _euler(self, m: Any, stamp_ns: int, steady_ns: int) -> None:
        q = quaternion_from_euler(m.roll, m.pitch, m.yaw)
        self._make_pose(q, m.time_boot_ms, stamp_ns, steady_ns)

    def _quaternion(self, m: Any, stamp_ns: int, steady_ns: int) -> None:
        size = _size(m)
        unit = (m.q1 / size, m.q2 / size, m.q3 / size, m.q4 / size)
        self._make_pose(unit, m.time_boot_ms, stamp_ns, steady_ns)

    def _make_pose(self, q: Quaternion, boot_ms: int, stamp_ns: int, steady_ns: int) -> None:
        """Bring the newest position to the moment of the attitude, by its velocity."""
        self._yaw_rad = yaw_from_quaternion(q)
        at = self._position
        limit_ns = self._parameters.pose_limit_s * 1e9
        if at is None or steady_ns - at.steady_ns > limit_ns or self.position_problem(steady_ns):
            self._make_bare_pose(q, boot_ms, stamp_ns, steady_ns)
            return
        dt = (boot_ms - at.report.boot_ms) / 1000.0
        dt = max(-MAX_EXTRAPOLATION_S, min(MAX_EXTRAPOLATION_S, dt))
        north, east, down = (
            p + dt * v for p, v in zip(at.report.position_m, at.report.velocity_m_s, strict=True)
        )
        self._pose = Pose(
            stamp_ns=self._clock.stamp_ns(boot_ms, stamp_ns),
            north_m=north,
            east_m=east,
            down_m=down,
            quaternion_ned_frd=q,
            altitude_agl_m=self._altitude_m(down, q, steady_ns),
        )
        # A pose is as old as the older of its parts, or the two limits would add up.
        self._pose_ns = min(steady_ns, at.steady_ns)
        self.poses.append(self._pose)

    def _make_bare_pose(self, q: Quaternion, boot_ms: int, stamp_ns: int, steady_ns: int) -> None:
        """Report attitude and altitude only; images may replace the position."""
        height = self._height
        limit_ns = self._parameters.pose_limit_s * 1e9
        if height is None or steady_ns - height.steady_ns > limit_ns or self._watch.problem:
            return
        above_home_m = height.at_m(boot_ms)
        self.poses.append(
            Pose(
                stamp_ns=self._clock.stamp_ns(boot_ms, stamp_ns),
                north_m=nan,
                east_m=nan,
                down_m=(self._home.down_m or 0.0) - above_home_m,
                quaternion_ned_frd=q,
                altitude_agl_m=self._above_ground_m(above_home_m, q, steady_ns),
            )
        )

    def _altitude_m(self, down_m: float, q: Quaternion, steady_ns: int) -> float:
        return self._above_ground_m((self._home.down_m or 0.0) - down_m, q, steady_ns)

    def _above_ground_m(self, above_home: float, q: Quaternion, steady_ns: int) -> float:
        if self._parameters.altitude_source != 'rangefinder' or self._range is None:
            return above_home
        seen_ns, distance_m = self._range
        if steady_ns - seen_ns > RANGE_LIMIT_S * 1e9:
            return above_home
        return distance_m * max(0.0, 1.0 - 2.0 * (q[1] ** 2 + q[2] ** 2))

    def _distance(self, m: Any, _stamp_ns: int, steady_ns: int) -> None:
        if m.orientation != mavlink.MAV_SENSOR_ROTATION_PITCH_270:
            return
        in_range = m.min_distance < m.current_distance < m.max_distance
        self._range = (steady_ns, m.current_distance / 100.0) if in_range else None

    def _take_home(self, m: Any, _stamp_ns: int, _steady_ns: int) -> None:
        believed = self._home.take_home(m.altitude / 1e3, m.z, flying=self._is_flying)
        self.rejected += not believed

    def _take_origin(self, m: Any, _stamp_ns: int, _steady_ns: int) -> None:
        believed = self._home.take_origin(m.altitude / 1e3, flying=self._is_flying)
        self.rejected += not believed

    def _take_height(self, m: Any, _stamp_ns: int, steady_ns: int) -> None:
        self._height = height_of(m, steady_ns)

    @property
    def _is_flying(self) -> bool:
        return self._armed and self.landed_state != mavlink.MAV_LANDED_STATE_ON_GROUND

    def _landed(self, m: Any, _stamp_ns: int, _steady_ns: int) -> None:
        self.landed_state = m.landed_state

    def _health(self, m: Any, _stamp_ns: int, _steady_ns: int) -> None:
        # -1 says that the autopilot does not measure it.
        self._battery = m.battery_remaining / 100.0 if 0 <= m.battery_remaining <= 100 else None

    def _estimate(self, m: Any, _stamp_ns: int, steady_ns: int) -> None:
        self._estimator = (steady_ns, int(m.flags))

    def _text(self, m: Any, _stamp_ns: int, steady_ns: int) -> None:
        self.texts.take(m, steady_ns)


def _size(m: Any) -> float:
    return sqrt(m.q1 * m.q1 + m.q2 * m.q2 + m.q3 * m.q3 + m.q4 * m.q4)


def _is_sane(kind: str, message: Any) -> bool:
    if not all(isfinite(getattr(message, name)) for name in NUMBERS.get(kind, ())):
        return False
    return kind != 'ATTITUDE_QUATERNION' or 0.9 < _size(message) < 1.1


_HANDLERS = {
    'HEARTBEAT': Assembler._heartbeat,  # noqa: SLF001
    'LOCAL_POSITION_NED': Assembler._local_position,  # noqa: SLF001
    'ATTITUDE': Assembler._euler,  # noqa: SLF001
    'ATTITUDE_QUATERNION': Assembler._quaternion,  # noqa: SLF001
    'DISTANCE_SENSOR': Assembler._distance,  # noqa: SLF001
    'HOME_POSITION': Assembler._take_home,  # noqa: SLF001
    'GPS_GLOBAL_ORIGIN': Assembler._take_origin,  # noqa: SLF001
    'GLOBAL_POSITION_INT': Assembler._take_height,  # noqa: SLF001
    'ALTITUDE': Assembler._take_height,  # noqa: SLF001
    'EXTENDED_SYS_STATE': Assembler._landed,  # noqa: SLF001
    'SYS_STATUS': Assembler._health,  # noqa: SLF001
    'EKF_STATUS_REPORT': Assembler._estimate,  # noqa: SLF001
    'ESTIMATOR_STATUS': Assembler._estimate,  # noqa: SLF001
    'STATUSTEXT': Assembler._text,  # noqa: SLF001
}
