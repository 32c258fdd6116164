# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The state machine of the simulated autopilot: arming, modes, take-off, landing, failsafes.

Pure: it knows the physics and the filter, but no socket and no wall clock. What it wants to tell
the ground lies in ``texts`` until the server takes it.
"""

from __future__ import annotations

from collections import deque
from dataclasses import replace
from math import inf, isfinite

from peace_ros.simulation.autopilot.commander import SecondCommander
from peace_ros.simulation.autopilot.datum import Datum, Vector
from peace_ros.simulation.autopilot.estimate_errors import (
    BarometerError,
    EstimateErrors,
    GnssAltitudeError,
)
from peace_ros.simulation.autopilot.estimator import RECKONS_PX4_S, RECKONS_S, Estimator
from peace_ros.simulation.autopilot.fence import Fence
from peace_ros.simulation.autopilot.guided import PlaceTarget, PositionTarget
from peace_ros.simulation.autopilot.modes import RULES, LandedState, Mode, Result, Severity
from peace_ros.simulation.autopilot.parameter_store import (
    CRUISE_SPEED,
    RTL_ALTITUDE,
    TAKE_OFF_ALTITUDE,
    ParameterStore,
)
from peace_ros.simulation.autopilot.personality import (
    OFFBOARD_LOSS_S,
    SETPOINT_FRAMES_PX4,
    Personality,
)
from peace_ros.simulation.autopilot.physics import Physics, VelocityCommand
from peace_ros.simulation.autopilot.steering import Steering

AUTO_DISARM_S = 10.0
LANDED_AFTER_S = 1.0
"""Time on the ground after which the vehicle calls itself landed."""
SPOOL_UP_S = 2.5
PREARM_TEXT_EVERY_S = 30.0
FORCE_MAGIC = 21196
"""param2 of the arm command that skips the checks."""
LOW_BATTERY, CRITICAL_BATTERY = 0.2, 0.1


class Flight:
    """One power-on of the autopilot."""

    def __init__(
        self,
        physics: Physics,
        personality: Personality | None = None,
        datum: Datum | None = None,
        errors: EstimateErrors | None = None,
        gnss: GnssAltitudeError | None = None,
        parameters: ParameterStore | None = None,
    ) -> None:
        self.physics = physics
        self.personality = personality or Personality()
        self.datum = datum or Datum()
        self.parameters = parameters or ParameterStore(self.personality)
        self.estimator = Estimator(RECKONS_PX4_S if self.personality.is_px4 else RECKONS_S)
        self.errors = errors or EstimateErrors()
        self.barometer = BarometerError()
        self.gnss = gnss or GnssAltitudeError(0.0)
        self.fence = Fence()
        self.commander = SecondCommander()
        self.time_s = 0.0
        self.mode = Mode.STABILIZE
        self.armed = False
        self.landed = True
        self.texts: deque[tuple[int, str]] = deque(maxlen=100)
        self.battery_remaining = 1.0
        self.setpoints = 0
        """Velocity set-points that have come, whoever sent them."""
        self.setpoints_refused = 0
        """Those of them that the mode or the frame left without effect."""
        self._setpoint_s: float | None = None
        self._lost_offboard = False
        """The present mode was chosen because the set-points stopped."""
        self._take_off_m = 0.0
        self.mode_changes = 0
        self.home_changes = 0
        self.home_m = (physics.north_m, physics.east_m, 0.0)
        """Launch point, local NED; set again at each arming."""
        self._last_position_m = self.home_m
        # A velocity set-point leaves PX4's position uncontrolled, also one of zero.
        self._steering = Steering(physics, holds_point=not self.personality.is_px4)
        self._stick_until_s = inf
        self._on_ground_s = 0.0
        self._armed_idle_s = 0.0
        self._next_prearm_text_s = 5.0
        self._was_ready = False
        self.say(Severity.INFO, self.personality.banner)

    @property
    def has_position(self) -> bool:
        """The filter knows where it is, well enough for GUIDED."""
        return self.estimator.has_position(self.time_s)

    @property
    def position_m(self) -> tuple[float, float, float]:
        """North, east, down as the filter estimates them."""
        if self.estimator.stale_position and not self.has_position:
            return self._last_position_m
        offset, wrong = self.estimator.offset_m, self.errors.position_m
        north, east, down = self._truth
        down += offset[2] - self.barometer.height_m
        return north + offset[0] + wrong[0], east + offset[1] + wrong[1], down

    @property
    def velocity_m_s(self) -> tuple[float, float, float]:
        """North, east, down as the filter estimates them."""
        north, east, down = self.physics.velocity_ned_m_s
        if self.physics.on_ground:
            return north, east, down  # a filter knows when it is at rest
        wrong = self.errors.velocity_m_s
        return north + wrong[0], east + wrong[1], down - self.barometer.climb_m_s

    @property
    def last_place_m(self) -> tuple[float, float, float]:
        """Position, or the last known place at the barometer's height while there is none."""
        if self.has_position:
            return self.position_m
        north, east, _ = self._last_position_m
        return north, east, self.physics.down_m - self.barometer.height_m

    @property
    def landed_state(self) -> LandedState:
        """What EXTENDED_SYS_STATE says."""
        if self.landed:
            taking_off = self.armed and self._steering.taking_off
            return LandedState.TAKEOFF if taking_off else LandedState.ON_GROUND
        if self._steering.taking_off:
            return LandedState.TAKEOFF
        if self._steering.landing(self.mode):
            return LandedState.LANDING
        return LandedState.IN_AIR

    @property
    def setpoint_age_s(self) -> float | None:
        """Since the newest understood set-point, None before the first."""
        return None if self._setpoint_s is None else self.time_s - self._setpoint_s

    @property
    def _truth(self) -> tuple[float, float, float]:
        return self.physics.north_m, self.physics.east_m, self.physics.down_m

    def step(self, dt_s: float) -> None:
        """Advance the clock, the failsafes and the vehicle."""
        self.time_s += dt_s
        self.errors.step(dt_s)
        self.barometer.step(dt_s)
        self._steering.height_error_m = self.barometer.height_m
        self.gnss.step(dt_s)
        failsafe = self.estimator.step(self.time_s)
        if self.has_position:
            self._last_position_m = self.position_m
        self._tell_readiness()
        if failsafe and self.armed and not self.landed and RULES[self.mode].needs_position:
            self.say(Severity.CRITICAL, 'EKF Failsafe: changed to LAND Mode')
            self._enter(Mode.LAND)
        if self.time_s > self._stick_until_s:
            self.move_throttle(0.0)
        rival = self.commander.due(self.time_s)
        if rival is not None:
            self.take_velocity(rival)
        self._watch_offboard()
        self._watch_fence()
        self._take_off_by_mode()
        command = self._steering.command(
            dt_s,
            self.mode,
            self.position_m,
            armed=self.armed,
            landed=self.landed,
            has_position=self.has_position,
        )
        if self.mode is Mode.GUIDED and not self.personality.is_px4:
            command = self.fence.kept(command, self.position_m, self.time_s)
        self.physics.step(dt_s, self._as_estimated(command))
        self._feel_ground(dt_s)

    def _as_estimated(self, command: VelocityCommand) -> VelocityCommand:
        """Return what the vehicle really does: it flies by the velocity that it estimates.

        Measured, PX4 v1.17-alpha: told 0.7 m/s it reports 0.45 m/s and hardly moves. In the same
        way a height that glides up lets the vehicle sink; that it does was not measured.
        """
        north, east = self.errors.velocity_m_s
        return replace(
            command,
            v_north_m_s=command.v_north_m_s - north,
            v_east_m_s=command.v_east_m_s - east,
            v_down_m_s=command.v_down_m_s + self.barometer.climb_m_s,
        )

    def set_mode(self, number: int) -> Result:
        """Change the mode for whoever asks: companion, ground station or switch."""
        try:
            mode = Mode(number)
        except ValueError:
            self.say(Severity.WARNING, f'Mode change failed: no such mode {number}')
            return Result.FAILED
        if mode is self.mode:
            return Result.ACCEPTED
        name = self.personality.mode_name(mode)
        if self.personality.is_px4 and mode is Mode.GUIDED and not self._stream_flows():
            self.say(Severity.CRITICAL, f'Switching to {name} is currently not available')
            return self.personality.refused
        # Disarmed, any mode may be chosen: the arming checks look at the position then.
        if self.armed and RULES[mode].needs_position and not self.has_position:
            self.say(Severity.WARNING, f'Mode change to {name} failed: requires position')
            return self.personality.refused
        self._enter(mode)
        return Result.ACCEPTED

    def arm(self, *, force: bool = False) -> Result:
        """Start the motors if mode and checks allow it."""
        if self.armed:
            return Result.ACCEPTED
        if not RULES[self.mode].armable:
            self.say(Severity.CRITICAL, f'Arm: {self.mode.name} mode not armable')
            return Result.FAILED
        problem = self.prearm_problem()
        if problem and not force:
            self.say(Severity.CRITICAL, f'Arm: {problem}')
            return Result.FAILED
        self.armed = True
        self._armed_idle_s = 0.0
        self._set_home()
        self.say(Severity.INFO, 'Arming motors')
        return Result.ACCEPTED

    def disarm(self, *, force: bool = False) -> Result:
        """Stop the motors; in the air only when forced."""
        if self.armed and not self.landed and not force:
            self.say(Severity.CRITICAL, 'Disarm: vehicle is flying')
            return Result.FAILED
        self._stop_motors()
        return Result.ACCEPTED

    def take_off(self, altitude_m: float) -> Result:
        """Climb to an altitude: above home, only in GUIDED, armed and on the ground (ArduPilot).

        PX4: above sea level, in a mode of its own; not a number: to MIS_TAKEOFF_ALT.
        """
        if self.personality.is_px4:
            above_sea_m = altitude_m - self.datum.altitude_msl_m
            by_default = not isfinite(altitude_m)
            self._take_off_m = (
                self.parameters.flown(TAKE_OFF_ALTITUDE) if by_default else above_sea_m
            )
            return self.set_mode(Mode.TAKEOFF) if self._take_off_m > 0.0 else Result.DENIED
        if not isfinite(altitude_m):
            return Result.DENIED
        if self.mode is not Mode.GUIDED or not self.armed or not self.landed or altitude_m <= 0.0:
            return Result.FAILED
        self._steering.take_off(altitude_m, SPOOL_UP_S)
        self._armed_idle_s = 0.0
        return Result.ACCEPTED

    def take_velocity(self, target: PositionTarget) -> None:
        """Take a set-point, which only GUIDED obeys; it ends a take-off."""
        self.setpoints += 1
        if self.personality.is_px4 and target.frame not in SETPOINT_FRAMES_PX4:
            self.say(
                Severity.CRITICAL,
                f'SET_POSITION_TARGET_LOCAL_NED coordinate frame {target.frame} unsupported',
            )
            self.setpoints_refused += 1
            return
        if all(isfinite(each) for each in target.velocity_m_s):
            self._setpoint_s = self.time_s
        if self.mode is Mode.GUIDED:
            self._steering.take_velocity(target)
        else:
            self.setpoints_refused += 1

    def take_place(self, target: PlaceTarget) -> None:
        """Take a place to fly to, which only GUIDED obeys; it ends a take-off."""
        self.setpoints += 1
        self._setpoint_s = self.time_s
        if self.mode is Mode.GUIDED:
            self._steering.take_place(target)
        else:
            self.setpoints_refused += 1

    def refuse_place(self) -> None:
        """Take a place that cannot be: ArduPilot stops (its source text), PX4 ignores it."""
        self.setpoints += 1
        self.setpoints_refused += 1
        if self.mode is Mode.GUIDED and not self.personality.is_px4:
            self._steering.stop()

    def reposition(self, target: PlaceTarget, *, change_mode: bool) -> Result:
        """Fly to a place by DO_REPOSITION: in GUIDED, or in AUTO.LOITER of PX4.

        Without the mode and without leave to change it: DENIED by ArduPilot, UNSUPPORTED by PX4
        (their source texts, not measured).
        """
        mode = Mode.BRAKE if self.personality.is_px4 else Mode.GUIDED
        if not change_mode and self.personality.is_px4:
            return Result.UNSUPPORTED
        if self.mode is not mode:
            if not change_mode:
                return Result.DENIED
            if (result := self.set_mode(mode)) is not Result.ACCEPTED:
                return result
        self._steering.take_place(target)
        return Result.ACCEPTED

    def change_speed(self, cruise_m_s: float) -> Result:
        """Fly to places with another speed over the ground."""
        if not cruise_m_s > 0.0:
            return Result.DENIED
        if self.mode is not Mode.GUIDED and not self.personality.is_px4:
            return Result.FAILED
        self._steering.cruise_m_s = cruise_m_s
        return Result.ACCEPTED

    def turn(self, heading_rad: float) -> None:
        """Turn to a heading and hold it, until the next set-point or mode."""
        self._steering.turn_to_rad = heading_rad

    @property
    def throttle_stick(self) -> float:
        """Where the pilot holds the throttle, -1 (down) to 1 (up)."""
        return self._steering.throttle_stick

    def move_throttle(self, stick: float, for_s: float = inf) -> None:
        """Move the pilot's throttle stick: LOITER, POSHOLD and ALT_HOLD climb and sink with it.

        Args:
            stick: -1 (down) to 1 (up); 0 holds the height.
            for_s: After so long it is in the middle again.
        """
        self._steering.throttle_stick = max(-1.0, min(1.0, stick))
        self._stick_until_s = self.time_s + for_s

    def take_attitude(
        self, lean_rad: tuple[float, float], yaw_rad: float | None, thrust: float
    ) -> None:
        """Take SET_ATTITUDE_TARGET, which only GUIDED_NOGPS obeys."""
        if self.mode is Mode.GUIDED_NOGPS:
            self._steering.take_attitude(lean_rad, yaw_rad, thrust)

    def see(self, seen_m: tuple[float, float, float]) -> None:
        """Take a position of external navigation."""
        self.estimator.see(self.time_s, seen_m, self._truth)

    def turn_stick(self, yaw_rate_rad_s: float) -> None:
        """Move the pilot's yaw stick: it turns the vehicle in GUIDED too."""
        self._steering.stick_yaw_rate_rad_s = yaw_rate_rad_s

    def lose_gps(self, *, stale: bool) -> None:
        """Take GPS away; the last position is repeated when ``stale``."""
        self.estimator.gps = False
        self.estimator.stale_position = stale

    def restore_gps(self) -> None:
        """Give GPS back."""
        self.estimator.gps = True

    def lose_radio(self) -> None:
        """Radio failsafe: RTL, or LAND where that needs a position that is missing."""
        self.say(Severity.CRITICAL, 'Radio Failsafe')
        if self.armed and not self.landed and self.set_mode(Mode.RTL) is not Result.ACCEPTED:
            self._enter(Mode.LAND)

    def prearm_problem(self) -> str:
        """Return why arming is refused now; empty when it is not."""
        if not self.estimator.has_origin(self.time_s):
            return 'GPS 1: Bad fix'
        if RULES[self.mode].needs_position and not self.has_position:
            return 'Need Position Estimate'
        if not self.has_position and self.estimator.gps:
            return 'AHRS: waiting for home'
        return ''

    def revive(self, *, armed: bool) -> None:
        """Come up in the air after a reboot in flight: STABILIZE, armed or falling."""
        self.armed = armed
        self.landed = self.physics.on_ground

    def say(self, severity: int, text: str) -> None:
        """Tell a STATUSTEXT."""
        self.texts.append((int(severity), text))

    def set_battery(self, remaining: float, failsafe: Mode | None = None) -> None:
        """Set the charge, 0 to 1; when it is low, the mode of the failsafe is entered."""
        if remaining < LOW_BATTERY <= self.battery_remaining:
            self.say(Severity.CRITICAL, f'Battery 1 is low: {remaining:.0%} remaining')
        self.battery_remaining = remaining
        if failsafe is not None and remaining < LOW_BATTERY and self.armed and not self.landed:
            self._enter(failsafe)

    @property
    def target_m_s(self) -> tuple[float, float, float] | None:
        """North, east, down: the velocity that GUIDED follows, None in other modes."""
        following = self.mode is Mode.GUIDED and self._steering.place is None
        if not following or self._steering.taking_off:
            return None
        command = self._steering.target()
        if not self.personality.is_px4:
            command = self.fence.kept(command, self.position_m, self.time_s)
        return command.v_north_m_s, command.v_east_m_s, command.v_down_m_s

    @property
    def target_place_m(self) -> Vector | None:
        """North, east, down from home: the place that is flown to, None without one."""
        place = self._steering.place
        return None if place is None else place.place_m

    def _watch_fence(self) -> None:
        """PX4 holds when the vehicle crosses a fence (its default action; not measured)."""
        if not self.personality.is_px4 or self.mode is not Mode.GUIDED:
            return
        if self.fence.room_m(self.position_m) < 0.0:
            self.say(Severity.CRITICAL, 'Geofence exceeded: hold')
            self._enter(Mode.BRAKE)

    def _stream_flows(self) -> bool:
        age_s = self.setpoint_age_s
        return age_s is not None and age_s <= OFFBOARD_LOSS_S

    def _watch_offboard(self) -> None:
        """PX4 without a radio returns when the set-points stop, and obeys again when they flow.

        Measured, PX4 v1.17-alpha: set-points that came back during that RTL (3.08 s after a cut of
        3 s) put it back into OFFBOARD without anybody asking.
        """
        if not (self.personality.is_px4 and self.armed):
            return
        flows = self._stream_flows()
        if self.mode is Mode.GUIDED and not flows:
            self.say(Severity.CRITICAL, 'Failsafe activated: offboard control signal lost')
            self._enter(Mode.RTL if self.has_position else Mode.LAND)
            self._lost_offboard = True
        elif self.mode is Mode.RTL and self._lost_offboard and flows:
            self._enter(Mode.GUIDED)

    def _take_off_by_mode(self) -> None:
        if self.mode is not Mode.TAKEOFF or not self.armed or self._steering.taking_off:
            return
        if self.landed:
            self._steering.take_off(self._take_off_m, SPOOL_UP_S)
            self._armed_idle_s = 0.0
        else:
            self._enter(Mode.BRAKE)

    def _enter(self, mode: Mode) -> None:
        self.mode = mode
        self._lost_offboard = False
        self.mode_changes += 1
        self._steering.rtl_altitude_m = self.parameters.flown(RTL_ALTITUDE)
        self._steering.cruise_m_s = self.parameters.flown(CRUISE_SPEED)
        self._steering.enter(mode, has_position=self.has_position)

    def _stop_motors(self) -> None:
        if not self.armed:
            return
        self.armed = False
        self._steering.enter(self.mode, has_position=self.has_position)
        self.say(Severity.INFO, 'Disarming motors')

    def _set_home(self) -> None:
        if self.has_position:
            north, east, _ = self.position_m
            self.home_m = (north, east, 0.0)
            self.home_changes += 1

    def _tell_readiness(self) -> None:
        ready = self.has_position
        if ready and not self._was_ready:
            self.say(Severity.INFO, 'EKF3 IMU0 is using GPS')
            if self.home_changes == 0:
                self._set_home()
        self._was_ready = ready
        if self.time_s < self._next_prearm_text_s:
            return
        self._next_prearm_text_s += PREARM_TEXT_EVERY_S
        problem = self.prearm_problem()
        if problem and not self.armed:
            self.say(Severity.CRITICAL, f'PreArm: {problem}')

    def _feel_ground(self, dt_s: float) -> None:
        if not self.physics.on_ground:
            self.landed = False
            self._on_ground_s = self._armed_idle_s = 0.0
            return
        if self._steering.taking_off:
            return
        self._on_ground_s += dt_s
        self.landed = self.landed or self._on_ground_s >= LANDED_AFTER_S
        if not (self.landed and self.armed):
            return
        self._armed_idle_s += dt_s
        if self._steering.landing(self.mode) or self._armed_idle_s >= AUTO_DISARM_S:
            self._stop_motors()
