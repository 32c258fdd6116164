# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""From the autopilot's messages to Telemetry and Poses; pure, with the clocks handed in."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from math import hypot, nan
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from peace_ros.core.domain.camera import Quaternion
from peace_ros.core.domain.geometry import quaternion_from_euler, yaw_from_quaternion
from peace_ros.core.domain.motion import HeightReport, Pose, Telemetry
from peace_ros.core.vehicle.boots import BootClock, BootMoment
from peace_ros.core.vehicle.clock import TimeMap
from peace_ros.core.vehicle.dialects import Dialect
from peace_ros.core.vehicle.gimbal import MESSAGE as GIMBAL
from peace_ros.core.vehicle.gimbal import GimbalWatch
from peace_ros.core.vehicle.gnss import GnssWatch
from peace_ros.core.vehicle.heights import (
    MAX_EXTRAPOLATION_S,
    Height,
    HomeHeight,
    OtherHeights,
    height_of,
)
from peace_ros.core.vehicle.parameters import VehicleParameters
from peace_ros.core.vehicle.stops import MESSAGES, Stops
from peace_ros.core.vehicle.texts import StatusTexts
from peace_ros.core.vehicle.trust import JumpWatch, Pairwise, PoseReport

RANGE_LIMIT_S = 0.5
MAX_POSES = 256
ESTIMATOR_LIMIT_S = 3.0
"""Age at which the report of the position filter about itself is stale."""
KNOWS_POSITION = mavlink.ESTIMATOR_POS_HORIZ_REL | mavlink.ESTIMATOR_POS_HORIZ_ABS
GLOBAL_POSITION = mavlink.ESTIMATOR_POS_HORIZ_ABS
GUESSES_POSITION = mavlink.ESTIMATOR_CONST_POS_MODE
"""PX4 sets it for a vehicle at rest too, beside the bit of a global position, which it then has."""
IN_ORDER = frozenset(
    {'LOCAL_POSITION_NED', 'ATTITUDE', 'ATTITUDE_QUATERNION', 'GLOBAL_POSITION_INT', GIMBAL}
)
"""Of these only the newest is used, in whatever order they are received."""
FARTHEST_M, HIGHEST_MM, FASTEST_M_S, TURN_RAD = 1e6, 2e7, 100.0, 7.0
LIMITS: dict[str, tuple[tuple[str, float], ...]] = {
    'LOCAL_POSITION_NED': (
        *((axis, FARTHEST_M) for axis in 'xyz'),
        *((f'v{axis}', FASTEST_M_S) for axis in 'xyz'),
    ),
    'ATTITUDE': tuple((angle, TURN_RAD) for angle in ('roll', 'pitch', 'yaw')),
    'ATTITUDE_QUATERNION': tuple((f'q{i}', 1.1) for i in range(1, 5)),
    'HOME_POSITION': (('z', FARTHEST_M), ('altitude', HIGHEST_MM)),
    'GPS_GLOBAL_ORIGIN': (('altitude', HIGHEST_MM),),
    'GLOBAL_POSITION_INT': (('relative_alt', HIGHEST_MM),),
    'GPS_RAW_INT': (('alt', HIGHEST_MM),),
    'TERRAIN_REPORT': (('current_height', FARTHEST_M),),
}
"""Fields that must be numbers, and the largest size of each that a multicopter can reach."""


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
        self._absurd = ''
        """Why the newest position was rejected, empty when it was not."""
        self._battery: float | None = None
        self._mode = ''
        self._armed = False
        self._heartbeat_ns: int | None = None
        self._boots = BootClock()
        self._forget()

    def _forget(self) -> None:
        """Forget what a reboot invalidates; mode and armed stay valid until the next HEARTBEAT."""
        self._position: _Position | None = None
        self._pose: Pose | None = None
        self._pose_ns = 0
        self._yaw_rad = 0.0
        self._home = HomeHeight(is_local=self._dialect.home_is_local)
        self._height: Height | None = None
        self._heights = Pairwise(self._parameters.jump_limit_m)
        self._range: tuple[int, float] | None = None
        self._ranges = Pairwise(self._parameters.jump_limit_m, first=False)
        self._others = OtherHeights(self._parameters.jump_limit_m)
        self._newest_boot_ms: dict[str, int] = {}
        self._estimator: tuple[int, int, int] | None = None
        """Steady clock, flags, flags of the report before."""
        self._gnss = GnssWatch()
        self._gimbal = GimbalWatch(self._parameters.gimbal_id, self._parameters.pose_limit_s)
        self.stops = Stops()
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
        if handler is None or (kind == GIMBAL and not self._parameters.follow_gimbal):
            return
        absurd = _absurd(kind, message)
        if kind == 'LOCAL_POSITION_NED':
            self._absurd = absurd
        if absurd:
            self.rejected += 1
        elif self._is_late(message, kind, steady_ns):
            self.late += 1
        else:
            self.arrived_ns[message.get_msgId()] = steady_ns
            handler(self, message, stamp_ns, steady_ns)

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
    def report(self) -> PoseReport | None:
        """The newest believed position, None before the first."""
        return None if self._position is None else self._position.report

    def heartbeat_age_s(self, steady_ns: int) -> float:
        """Return the time since the newest HEARTBEAT, infinite before the first."""
        if self._heartbeat_ns is None:
            return float('inf')
        return (steady_ns - self._heartbeat_ns) / 1e9

    def position_problem(self, steady_ns: int) -> str:
        """Return why there is no position to fly by, empty when nothing speaks against it."""
        flags = self._estimator_flags(steady_ns)
        if flags is not None and not _has_position(flags):
            fix = f' ({self._gnss.fix_note})' if self._gnss.fix_note else ''
            return (
                f'the autopilot has no estimate of its position (filter flags 0x{flags:X}) and '
                f'refuses velocity set-points: it needs GNSS{fix}, external navigation or optical '
                'flow'
            )
        return self._absurd or self._gnss.problem or self._watch.problem

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
            fence=self.stops.fence(steady_ns),
            other_commander=self.stops.other_commander(steady_ns),
            explanation=self.stops.explanation(steady_ns),
            v_north_m_s=velocity[0],
            v_east_m_s=velocity[1],
            v_down_m_s=velocity[2],
            armed=self._armed,
            in_control=self._mode == self._dialect.control_mode,
            mode=self._mode,
            landed=None if state == 0 else state == mavlink.MAV_LANDED_STATE_ON_GROUND,
            status_text=self.texts.newest,
            battery_remaining=self._battery,
            gimbal=self._gimbal.fresh(steady_ns),
            heights=() if pose is None else self._other_heights(pose, steady_ns),
        )

    def _other_heights(self, pose: Pose, steady_ns: int) -> tuple[HeightReport, ...]:
        return self._others.fresh(steady_ns, _level_share(pose.quaternion_ned_frd))

    def _doubt(self, steady_ns: int) -> str:
        """Return why the reported position is rejected, empty when it is accepted."""
        problem = self.position_problem(steady_ns)
        limit_s, age_s = self._parameters.heartbeat_limit_s, self.heartbeat_age_s(steady_ns)
        if problem or self._heartbeat_ns is None or age_s <= limit_s:
            return problem
        return f'no HEARTBEAT for more than {limit_s:g} s: it is unknown who controls the vehicle'

    def _estimator_flags(self, steady_ns: int) -> int | None:
        """Return the flags; a position that came back counts from the second report on."""
        if self._estimator is None or steady_ns - self._estimator[0] > ESTIMATOR_LIMIT_S * 1e9:
            return None
        _, flags, before = self._estimator
        return flags if not _has_position(flags) else before

    def _is_late(self, message: Any, kind: str, steady_ns: int) -> bool:
        boot_ms: int | None = getattr(message, 'time_boot_ms', None)
        if boot_ms is None:
            return False
        # Several gimbals are reported in the same millisecond.
        series = f'{kind} {message.gimbal_device_id}' if kind == GIMBAL else kind
        before_ms = self._boots.newest_ms
        moment = self._boots.judge(boot_ms, steady_ns, self._heartbeat_ns)
        if moment is BootMoment.DOUBTFUL:
            return True
        if moment is BootMoment.REBOOTED:
            self.reboots += 1
            self._forget()
        elif moment is BootMoment.STEPPED:
            self._follow_clock(boot_ms - before_ms)
        newest_ms = self._newest_boot_ms.get(series, -1)
        self._newest_boot_ms[series] = max(newest_ms, boot_ms)
        return kind in IN_ORDER and boot_ms <= newest_ms

    def _follow_clock(self, by_ms: int) -> None:
        """Follow a clock that was set: what guards height and position stays."""
        self._position = self._height = None
        self._newest_boot_ms.clear()
        self._clock.forget()
        self._watch.shift(by_ms)

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
        return distance_m * _level_share(q)

    def _distance(self, m: Any, _stamp_ns: int, steady_ns: int) -> None:
        if m.orientation != mavlink.MAV_SENSOR_ROTATION_PITCH_270:
            return
        in_range = m.min_distance < m.current_distance < m.max_distance
        distance_m = m.current_distance / 100.0
        if self._ranges.believes(distance_m):
            self._range = (steady_ns, distance_m) if in_range else None
            self._others.take_range(distance_m if in_range else None, steady_ns)

    def _take_home(self, m: Any, _stamp_ns: int, _steady_ns: int) -> None:
        if not self._home.take_home(m.altitude / 1e3, m.z, flying=self._is_flying):
            self._doubt_home(m)

    def _take_origin(self, m: Any, _stamp_ns: int, _steady_ns: int) -> None:
        if not self._home.take_origin(m.altitude / 1e3, flying=self._is_flying):
            self._doubt_home(m)

    def _doubt_home(self, m: Any) -> None:
        self.rejected += 1
        if not self._is_flying:
            self.arrived_ns.pop(m.get_msgId(), None)  # it is asked for again

    def _take_height(self, m: Any, _stamp_ns: int, steady_ns: int) -> None:
        height = height_of(m, steady_ns)
        if height is None or self._heights.believes(height.above_home_m):
            self._height = height

    @property
    def _is_flying(self) -> bool:
        return self._armed and self.landed_state != mavlink.MAV_LANDED_STATE_ON_GROUND

    def _landed(self, m: Any, _stamp_ns: int, _steady_ns: int) -> None:
        self.landed_state = m.landed_state

    def _health(self, m: Any, _stamp_ns: int, _steady_ns: int) -> None:
        # -1 says that the autopilot does not measure it.
        self._battery = m.battery_remaining / 100.0 if 0 <= m.battery_remaining <= 100 else None

    def _estimate(self, m: Any, _stamp_ns: int, steady_ns: int) -> None:
        flags = int(m.flags)
        before = flags if self._estimator is None else self._estimator[1]
        self._estimator = (steady_ns, flags, before)

    def _take_fix(self, m: Any, _stamp_ns: int, steady_ns: int) -> None:
        flags = self._estimator_flags(steady_ns)
        known = None if flags is None else _has_position(flags)
        self._gnss.take(m.get_type(), m.fix_type, self._boots.newest_ms, known=known)
        if m.get_type() == 'GPS_RAW_INT':
            self._others.take_fix(m, steady_ns)

    def _take_terrain(self, m: Any, _stamp_ns: int, steady_ns: int) -> None:
        self._others.take_terrain(m, steady_ns)

    def _take_gimbal(self, m: Any, stamp_ns: int, steady_ns: int) -> None:
        at_ns = self._clock.stamp_ns(m.time_boot_ms, stamp_ns, f'gimbal {m.gimbal_device_id}')
        self._gimbal.take(m, at_ns, steady_ns)

    def _text(self, m: Any, _stamp_ns: int, steady_ns: int) -> None:
        self.texts.take(m, steady_ns)
        whole = bool(self.texts.entries) and self.texts.entries[-1][0] == steady_ns
        if whole and m.severity <= mavlink.MAV_SEVERITY_WARNING:
            self.stops.take_text(self.texts.newest, steady_ns)

    def _take_stop(self, m: Any, _stamp_ns: int, steady_ns: int) -> None:
        self.stops.take(m, steady_ns)


def _size(m: Any) -> float:
    return hypot(*m.q) if m.get_type() == GIMBAL else hypot(m.q1, m.q2, m.q3, m.q4)


def _level_share(q: Quaternion) -> float:
    """Return the vertical part of a distance along body-down, 0 to 1."""
    return max(0.0, 1.0 - 2.0 * (q[1] ** 2 + q[2] ** 2))


def _has_position(flags: int) -> bool:
    guesses = flags & GUESSES_POSITION and not flags & GLOBAL_POSITION
    return bool(flags & KNOWS_POSITION) and not guesses


def _absurd(kind: str, message: Any) -> str:
    """Return which value cannot be believed, empty when all can."""
    for name, limit in LIMITS.get(kind, ()):
        value = getattr(message, name)
        if not abs(value) <= limit:  # also NaN
            return f'{kind} has {name} = {value:g}, limit {limit:g}: the message is rejected'
    if kind in {'ATTITUDE_QUATERNION', GIMBAL} and not 0.9 < _size(message) < 1.1:
        return f'{kind} of size {_size(message):g}: must be 1'
    return ''


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
    'GPS_RAW_INT': Assembler._take_fix,  # noqa: SLF001
    'GPS2_RAW': Assembler._take_fix,  # noqa: SLF001
    'TERRAIN_REPORT': Assembler._take_terrain,  # noqa: SLF001
    'EKF_STATUS_REPORT': Assembler._estimate,  # noqa: SLF001
    'ESTIMATOR_STATUS': Assembler._estimate,  # noqa: SLF001
    GIMBAL: Assembler._take_gimbal,  # noqa: SLF001
    'STATUSTEXT': Assembler._text,  # noqa: SLF001
    **dict.fromkeys(MESSAGES, Assembler._take_stop),  # noqa: SLF001
}
