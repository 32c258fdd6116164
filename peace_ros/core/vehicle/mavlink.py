# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The link: one thread reads and sends what is periodic; requests wait for an answer, limited."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from dataclasses import replace
from math import isfinite
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from peace_ros.core.domain.errors import VehicleError
from peace_ros.core.domain.geometry import lean_acceleration
from peace_ros.core.domain.motion import Pose, Setpoint, Telemetry
from peace_ros.core.threads import GuardedThread, OnDefect, print_defect
from peace_ros.core.vehicle.assembler import Assembler
from peace_ros.core.vehicle.clock import TimeMap
from peace_ros.core.vehicle.control import Control
from peace_ros.core.vehicle.dialects import Dialect, choose_dialect, level_message
from peace_ros.core.vehicle.housekeeping import Housekeeping
from peace_ros.core.vehicle.lasting import LastingTransport
from peace_ros.core.vehicle.obedience import ObedienceWatch, ReportedMotion
from peace_ros.core.vehicle.parameters import VehicleParameters
from peace_ros.core.vehicle.peer import Peer
from peace_ros.core.vehicle.requests import Requests
from peace_ros.core.vehicle.result import Answer, LineCounts, RequestResult
from peace_ros.core.vehicle.signing import Signer
from peace_ros.core.vehicle.streams import StreamKeeper
from peace_ros.core.vehicle.transport import Source
from peace_ros.core.vehicle.wire import Wire

READ_S = 0.02
ZERO_STREAM_NS = 50_000_000
OBEDIENCE_NS = 20_000_000
"""The obedience watch looks this often, also while nothing is heard."""
PRE_STREAM_S = 0.6
THRUST_AS_THRUST = 8
"""Bit of ArduCopter's GUID_OPTIONS with which thrust no longer means climb rate."""


class MavlinkLink:
    """Talks to one autopilot, and ignores all others.

    Args:
        transport: An open line; the link closes it.
        dialect: ``auto`` or a name among the registered ones.
        parameters: Rates and limits.
        clock_ns: Node clock; poses are stamped with it.
        on_defect: Takes what ended the reading thread.

    Raises:
        ConfigurationError: The signing key cannot be read.
        VehicleError: No autopilot was heard in time, or one that the dialect does not fit.
    """

    def __init__(
        self,
        transport: LastingTransport,
        dialect: str,
        parameters: VehicleParameters,
        clock_ns: Callable[[], int],
        on_defect: OnDefect | None = None,
    ) -> None:
        self._transport = transport
        self._wanted_dialect = dialect
        self._parameters = parameters
        self._clock_ns = clock_ns
        key_file = parameters.signing_key_file
        signer = Signer.from_file(key_file, parameters.system_id) if key_file else None
        self._wire = Wire(parameters.system_id, signer, datagrams=transport.datagrams)
        self._changed = threading.Condition()
        self._stop = threading.Event()
        self._opened_ns = time.monotonic_ns()
        self._peer = Peer(parameters.vehicle_id, self._opened_ns)
        ours = (parameters.system_id, int(mavlink.MAV_COMP_ID_ONBOARD_COMPUTER))
        self._requests = Requests(self._changed, parameters.request_limit_s, ours)
        self._clock = TimeMap()
        self._dialect: Dialect | None = None
        self._assembler: Assembler | None = None
        self._house = Housekeeping(self._clock, clock_ns)
        self._error: VehicleError | None = None
        self._openings = 1
        self._control = Control()
        self._zero_until_ns = 0
        self._stream_due_ns = 0
        self._holding_level = False
        self._bytes_heard = 0
        self._obedience = ObedienceWatch()
        self._obedience_due_ns = 0
        self._report = on_defect or print_defect
        self._thread = GuardedThread(self._run, 'mavlink_link', self._on_defect)
        self._thread.start()
        self._await_autopilot()

    @property
    def dialect(self) -> Dialect:
        """How this autopilot speaks."""
        if self._dialect is None:
            raise VehicleError('no autopilot has been heard yet: wait for its HEARTBEAT')
        return self._dialect

    @property
    def taken_over(self) -> bool:
        """A person or a failsafe has left the mode that obeys us, since we were last in it."""
        return self._control.taken_over

    @property
    def problem(self) -> str:
        """Why the vehicle cannot be reached now, empty when it can."""
        if self._thread.defect is not None:
            return f'the thread that reads the autopilot has ended: {self._thread.defect!r}'
        if self._transport.problem:
            return self._transport.problem
        limit_s = self._parameters.heartbeat_limit_s
        with self._changed:
            age_s = self._heard().heartbeat_age_s(time.monotonic_ns())
        if age_s <= limit_s:
            return ''
        return f'no HEARTBEAT for more than {limit_s:g} s: check the autopilot and the line'

    @property
    def position_problem(self) -> str:
        """Why the autopilot will not obey velocities now, empty when nothing speaks against it."""
        with self._changed:
            now_ns = time.monotonic_ns()
            return self._heard().position_problem(now_ns) or self._disobedience(now_ns)

    @property
    def warning(self) -> str:
        """What a person should know of the line and the vehicle, empty when nothing."""
        with self._changed:
            battery = self._heard().stops.battery(time.monotonic_ns())
        return '; '.join(filter(None, (self._peer.warning, self._wire.warning, battery)))

    @property
    def counts(self) -> LineCounts:
        """Messages that were not used, since the line was opened."""
        with self._changed:
            heard = self._heard()
            return LineCounts(self._peer.ignored, *self._wire.refused, heard.rejected, heard.late)

    @property
    def landed_state(self) -> int:
        """MAV_LANDED_STATE: 0 unknown, 1 ground, 2 air, 3 take-off, 4 landing."""
        with self._changed:
            return self._heard().landed_state

    @property
    def home_msl_m(self) -> float | None:
        """Altitude of home above sea level, None until it is known."""
        with self._changed:
            return self._heard().home_msl_m

    def telemetry(self) -> Telemetry:
        """Return what the autopilot last said."""
        with self._changed:
            now_ns = time.monotonic_ns()
            told = self._heard().telemetry(now_ns)
            told = replace(told, mode_known=self._control.mode_known(now_ns))
            problem = self._disobedience(now_ns)
            return replace(told, pose=None, position_problem=problem) if problem else told

    def take_poses(self) -> list[Pose]:
        """Return the poses since the last call, oldest first (at most 256).

        While there is no position, north and east are NaN.
        """
        with self._changed:
            poses = list(self._heard().poses)
            self._heard().poses.clear()
            return poses

    def status_texts(self) -> list[str]:
        """Return the newest STATUSTEXTs, oldest first (at most 50)."""
        with self._changed:
            return [text for _, text in self._heard().texts.entries]

    def report_health(self, mav_state: int) -> None:
        """Report MAV_STATE in our HEARTBEAT from now on; a change is sent at once."""
        self._house.set_health(mav_state)

    def send_velocity(self, setpoint: Setpoint) -> None:
        """Send one set-point; it is not clamped, that is the guard's work.

        Raises:
            VehicleError: A component is not finite, or the line broke.
        """
        v = (setpoint.v_north_m_s, setpoint.v_east_m_s, setpoint.v_down_m_s)
        if not all(isfinite(each) for each in v):
            raise VehicleError(
                f'velocity set-point {v} m/s: all components must be finite; nothing was sent'
            )
        self._zero_until_ns = 0
        now_ns = time.monotonic_ns()
        with self._changed:
            self._obedience.tell(v, now_ns)
            self._heard().stops.tell(v, now_ns)
        self._send_setpoint(setpoint)

    def send_landing_target(self, site_ned_m: tuple[float, float, float], pose: Pose) -> None:
        """Send LANDING_TARGET for a point on the ground, local NED."""
        stamp_us = pose.stamp_ns // 1000 & 0xFFFF_FFFF_FFFF_FFFF
        self._send(self.dialect.landing_target_message(site_ned_m, pose, stamp_us))

    def request_control(self, *, by_person: bool = False) -> RequestResult:
        """Ask for the mode that obeys set-points; blocks at most ``request_limit_s`` and a bit.

        Once a person or a failsafe has taken over, this refuses by itself: pass ``by_person``
        only when a person asks for it anew.
        """
        if self.taken_over and not by_person:
            return RequestResult(
                Answer.REFUSED,
                f'{self.telemetry().mode} was chosen after we had control: a person must engage',
            )
        if problem := self.position_problem:
            return RequestResult(Answer.REFUSED, problem)
        self._control.ask_anew()
        self._holding_level = False
        if self.dialect.streams_before_control:
            limit_ns = int((self._parameters.request_limit_s + PRE_STREAM_S + 1.0) * 1e9)
            self._zero_until_ns = time.monotonic_ns() + limit_ns
            self._stop.wait(PRE_STREAM_S)
        result = self.set_mode(self.dialect.control_mode)
        if not result:
            self._zero_until_ns = 0
        return result

    def request_hold(self) -> RequestResult:
        """Ask for the autopilot's own hold mode; blocks at most ``request_limit_s`` and a bit."""
        return self.set_mode(self.dialect.hold_mode)

    def stop_at_once(self) -> bool:
        """Send zero velocity and ask once for the autopilot's own hold mode; awaits no answer.

        For a process that has to end: it needs no other thread of this link and not their lock.

        Returns:
            False when the vehicle obeys somebody else, or holds by itself: nothing was sent.

        Raises:
            VehicleError: The line broke.
        """
        heard, dialect = self._assembler, self._dialect
        if heard is None or dialect is None or self.taken_over:
            return False
        now_ns = time.monotonic_ns()
        if heard.mode != dialect.control_mode or not self._control.mode_known(now_ns):
            return False
        limit_ns = int(self._parameters.request_limit_s * 1e9)
        self._control.leave_to(dialect.hold_mode, now_ns + limit_ns)
        self._send_setpoint(Setpoint(stamp_ns=0))
        mode = (*dialect.mode_command(dialect.hold_mode), 0.0, 0.0, 0.0, 0.0)
        command = mavlink.MAV_CMD_DO_SET_MODE
        self._send(mavlink.MAVLink_command_long_message(*self._peer.target, command, 0, *mode))
        return True

    def request_land(self, wanted: Callable[[], bool] = lambda: True) -> RequestResult:
        """Ask for the autopilot's own landing, only while it obeys us and it is wanted."""
        if self.taken_over or not self.telemetry().in_control:
            return RequestResult(Answer.REFUSED, 'somebody else has control')
        return self.set_mode(self.dialect.land_mode, wanted)

    def request_level_hold(self) -> RequestResult:
        """Ask to be held level, at this height and heading, without any position.

        Only for a person who asks: the vehicle drifts with the wind. It lasts until the mode is
        changed or control is asked for; the set-points are sent by the link itself.
        """
        mode = self.dialect.level_mode
        if not mode:
            return RequestResult(
                Answer.REFUSED, f'{self.dialect.name} cannot hold its height without a position'
            )
        options = self._requests.parameter(self._send, self._peer.target, 'GUID_OPTIONS')
        if options is None or int(options) & THRUST_AS_THRUST:
            return RequestResult(
                Answer.REFUSED,
                f'GUID_OPTIONS is {options}: thrust must mean climb rate (bit 3 clear)',
            )
        result = self.set_mode(mode)
        self._holding_level = bool(result)
        return result

    def set_mode(self, mode: str, wanted: Callable[[], bool] = lambda: True) -> RequestResult:
        """Ask for a mode by the autopilot's own name and wait until HEARTBEAT shows it.

        It is asked again only while it is wanted and the mode is the one before: a person or a
        failsafe who changes the mode meanwhile is not overruled.
        """
        before = self._heard().mode
        flags, main, sub = self.dialect.mode_command(mode)
        deadline_ns = time.monotonic_ns() + int(self._parameters.request_limit_s * 1e9)
        if mode != self.dialect.control_mode:
            self._control.leave_to(mode, deadline_ns)
        result = self._command(
            mavlink.MAV_CMD_DO_SET_MODE,
            (flags, main, sub),
            lambda: wanted() and self._heard().mode == before,
        )
        if result.answer is Answer.NO_ANSWER and before != mode == self._heard().mode:
            result = RequestResult(Answer.ACCEPTED)  # the answer was lost
        if not result:
            self._control.stay()
            return result
        with self._changed:
            left_s = (deadline_ns - time.monotonic_ns()) / 1e9
            if not self._changed.wait_for(lambda: self._heard().mode == mode, max(0.0, left_s)):
                return RequestResult(
                    Answer.NO_ANSWER, f'{mode} was accepted, but HEARTBEAT does not show it', 0
                )
        self._control.stay()
        return result

    def command(self, command: int, *params: float) -> RequestResult:
        """Send a COMMAND_LONG, again each 0.7 s, until it is acknowledged or the limit is over.

        Args:
            command: MAV_CMD.
            params: Up to seven parameters; missing ones are 0.
        """
        return self._command(command, params)

    def _command(
        self, command: int, params: tuple[float, ...], wanted: Callable[[], bool] = lambda: True
    ) -> RequestResult:
        with self._changed:
            texts = self._heard().texts
        target = self._peer.target
        return self._requests.command(self._send, target, texts, command, params, wanted)

    def close(self) -> None:
        """Stop the thread and release the line; may be called twice."""
        self._stop.set()
        self._requests.end()
        if self._thread is not threading.current_thread():
            self._thread.join(timeout=2.0)
        self._transport.close()
        self._wire.keep(time.monotonic(), at_once=True)

    def _heard(self) -> Assembler:
        if self._assembler is None:
            raise VehicleError('no autopilot has been heard yet: wait for its HEARTBEAT')
        return self._assembler

    def _await_autopilot(self) -> None:
        limit_s = self._parameters.connect_timeout_s
        with self._changed:
            self._changed.wait_for(
                lambda: self._assembler or self._error or self._thread.defect, limit_s
            )
            if self._assembler is not None:
                return
            error = self._error
        self.close()
        count = sum(self._wire.refused)
        refused = f', {count} not rightly signed' if count else ''
        served = ''
        if not self._transport.datagrams and not self._bytes_heard:
            served = '; a TCP port of a simulation serves one client: is another connected'
        raise error or VehicleError(
            f'no HEARTBEAT of an autopilot within {limit_s} s ({self._bytes_heard} bytes heard'
            f'{refused}): check address, port, baud rate and that MAVLink 2 is sent to this line'
            f'{served}{self._peer.heard_instead()}'
        )

    def _run(self) -> None:
        while not self._stop.is_set() and self._error is None:
            for data, source in self._transport.read(READ_S):
                self._bytes_heard += len(data)
                for message in self._wire.decode(data):
                    self._take(message, source)
            if self._transport.openings != self._openings:
                self._begin_anew()
            self._watch_obedience(time.monotonic_ns())
            try:
                self._keep_house(time.monotonic_ns())
            except VehicleError:
                continue  # the transport reports the reason, and opens the line again

    def _on_defect(self, error: BaseException) -> None:
        self._report(error)
        with self._changed:
            self._changed.notify_all()

    def _watch_obedience(self, now_ns: int) -> None:
        """Compare what the vehicle reports with what it was told; the reading thread calls it."""
        heard = self._assembler
        if heard is None or now_ns < self._obedience_due_ns:
            return
        self._obedience_due_ns = now_ns + OBEDIENCE_NS
        with self._changed:
            told = heard.telemetry(now_ns)
            # What a fence or a second commander does proves nothing; a doubt of before stays.
            stopped = told.other_commander or heard.stops.limits_speed(now_ns)
            if not told.in_control or (stopped and not self._obedience.problem):
                self._obedience.forget()
            at, report, motion = told.pose, heard.report, None
            if at is not None and report is not None:
                motion = ReportedMotion(
                    (*report.position_m[:2], -at.altitude_agl_m),
                    report.velocity_m_s[:2],
                    lean_acceleration(at.quaternion_ned_frd),
                )
            reported_ns = heard.arrived_ns.get(mavlink.MAVLINK_MSG_ID_LOCAL_POSITION_NED, 0)
            boot_ns = 0 if report is None else report.boot_ms * 1_000_000
            self._obedience.take(motion, reported_ns, boot_ns)

    def _disobedience(self, now_ns: int) -> str:
        """Return that the vehicle does not follow, with what may explain it; empty when it does."""
        problem = self._obedience.problem
        why = self._heard().stops.hindrance(now_ns) if problem else ''
        return f'{problem} (the autopilot reports: {why})' if why else problem

    def _begin_anew(self) -> None:
        self._openings = self._transport.openings
        self._wire.restart()
        if self._house.streams is not None:
            self._house.streams.forget()

    def _take(self, message: Any, source: Source) -> None:
        now_ns = time.monotonic_ns()
        with self._changed:
            if self._assembler is None and not self._meet(message, source, now_ns):
                return
            if not self._peer.is_ours(message, source, now_ns):
                return
            assembler = self._heard()
            self._requests.take(message)
            self._control.hear(now_ns, is_mode=message.get_type() == 'HEARTBEAT')
            if message.get_type() == 'TIMESYNC':
                self._house.take_time(message)
            was_control = assembler.mode == self.dialect.control_mode
            assembler.take(message, self._clock_ns(), now_ns)
            if message.get_type() == 'HEARTBEAT':
                self._holding_level &= assembler.mode == self.dialect.level_mode
                if was_control and assembler.mode != self.dialect.control_mode:
                    self._zero_until_ns = 0
                    self._control.left_for(assembler.mode, now_ns)
            self._changed.notify_all()

    def _meet(self, message: Any, source: Source, now_ns: int) -> bool:
        """Choose the autopilot at its first HEARTBEAT; return whether it was chosen."""
        if not self._peer.is_candidate(message, source, now_ns):
            return False
        try:
            self._dialect = choose_dialect(
                self._wanted_dialect,
                message.autopilot,
                self._parameters.hold_mode,
                message.type,
            )
        except VehicleError as error:
            self._error = error
            self._changed.notify_all()
            return False
        self._peer.choose(message, source, now_ns)
        self._house.streams = StreamKeeper(self._parameters, self._dialect)
        self._control = Control(self._dialect.silence_limit_s)
        self._assembler = Assembler(self._dialect, self._parameters, self._clock)
        return True

    def _keep_house(self, now_ns: int) -> None:
        heartbeat = self._house.heartbeat(now_ns)
        if heartbeat is not None:
            self._wire.keep(now_ns / 1e9)
            self._send(heartbeat)
        if self._assembler is None:
            return
        with self._changed:
            requests = self._house.requests(now_ns, self._assembler, self._peer.target)
        for request in requests:
            self._send(request)
        if not self._control.mode_known(now_ns):
            self._zero_until_ns = 0
        flowing = self._holding_level or now_ns < self._zero_until_ns
        if not flowing or now_ns < self._stream_due_ns:
            return
        self._stream_due_ns = now_ns + ZERO_STREAM_NS
        if self._holding_level:
            yaw_rad = self._assembler.yaw_rad
            self._send(level_message(yaw_rad, self._since_opening_ms(), self._peer.target))
        else:
            self._send_setpoint(Setpoint(stamp_ns=0))

    def _since_opening_ms(self) -> int:
        return (time.monotonic_ns() - self._opened_ns) // 1_000_000

    def _send_setpoint(self, setpoint: Setpoint) -> None:
        now_ms, target = self._since_opening_ms(), self._peer.target
        self._send(self.dialect.velocity_message(setpoint, now_ms, target))

    def _send(self, message: Any) -> None:
        if self._error is not None:
            raise self._error
        self._transport.write(self._wire.pack(message), self._peer.source)
