# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Faults that can be put into the flying simulation at run time, unknown to the companion.

Three ways, one table (:data:`FAULTS`):

* in the same process: ``inject(sim, 'gps_loss', stale=True)``;
* from another process: start the autopilot with ``fault_port`` > 0 and use
  ``FaultClient(port).inject('gps_loss', stale=True)``, or send one JSON object per datagram,
  ``{"fault": "gps_loss", "stale": true}``; the answer is ``{"ok": true, ...}`` or
  ``{"ok": false, "error": "..."}``;
* the state of the vehicle as it truly is: the fault ``state`` changes nothing and answers it.

The port is bound to the loopback address whatever the MAVLink server listens on.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from inspect import Parameter, signature
from math import inf, isfinite, isinf, radians
from typing import TYPE_CHECKING, Any, TypeVar

from peace_ros.core.domain.errors import VehicleError
from peace_ros.simulation.autopilot.commander import SecondCommander
from peace_ros.simulation.autopilot.disturbance import Disturbance
from peace_ros.simulation.autopilot.fault_client import FaultClient
from peace_ros.simulation.autopilot.fence import Fence, FenceKind

if TYPE_CHECKING:
    from peace_ros.simulation.autopilot.autopilot import AutopilotSim

Answer = dict[str, Any]
__all__ = ['FAULTS', 'Answer', 'FaultClient', 'inject']
_Function = TypeVar('_Function', bound=Callable[..., Answer | None])

FAULTS: dict[str, Callable[..., Answer | None]] = {}
"""Name -> function; its keyword arguments are those of :func:`inject`."""


def _fault(function: _Function) -> _Function:
    FAULTS[function.__name__] = function
    return function


def inject(sim: AutopilotSim, fault: str, /, **arguments: Any) -> Answer:
    """Put one fault into a simulation; thread-safe.

    Args:
        sim: The simulation.
        fault: A name of :data:`FAULTS`.
        arguments: Those of the function of that name in this module.

    Returns:
        What the fault has to tell, empty for most; JSON types only.

    Raises:
        VehicleError: Unknown fault, wrong arguments, or values that cannot be used.
    """
    function = FAULTS.get(fault)
    if function is None:
        raise VehicleError(f'fault {fault!r} is unknown: choose one of {", ".join(sorted(FAULTS))}')
    try:
        signature(function).bind(sim, **arguments)
    except TypeError as error:
        raise VehicleError(f'fault {fault}: {error}; it takes {_arguments(function)}') from error
    try:
        with sim.lock:
            return function(sim, **arguments) or {}
    except (TypeError, ValueError, KeyError) as error:
        raise VehicleError(f'fault {fault} with {arguments}: {error}') from error


@_fault
def clear(sim: AutopilotSim) -> None:
    """Take every distortion away; what has happened (a reboot, a mode change) stays."""
    sim.disturbance.__dict__.update(vars(Disturbance()))
    sim.restore_gps()
    sim.flight.barometer.become(0.0)
    sim.pilot_yaw_stick(0.0)
    sim.pilot_throttle_stick(0.0)
    sim.flight.fence = Fence()
    sim.flight.commander = SecondCommander()


@_fault
def gps_loss(sim: AutopilotSim, *, stale: bool = False) -> None:
    """Lose GPS: dead reckoning for 7.1 s (PX4: 5.4 s), the EKF failsafe lands 0.8 s later.

    Args:
        sim: The simulation.
        stale: LOCAL_POSITION_NED continues with the last numbers instead of dead reckoning.
    """
    sim.lose_gps(stale=stale)


@_fault
def gps_restore(sim: AutopilotSim) -> None:
    """Give GPS back."""
    sim.restore_gps()


@_fault
def altitude(sim: AutopilotSim, *, kind: str = 'true', offset_m: float = 0.0) -> None:
    """Distort the reported altitude (LOCAL_POSITION_NED.z, GLOBAL_POSITION_INT).

    Args:
        sim: The simulation.
        kind: ``true`` ends it; ``nan``; ``sign`` (down and up swapped, speed too);
            ``freeze`` (the present one for ever); ``jump`` (``offset_m`` is added).
        offset_m: Of ``jump``, positive is higher.
    """
    _one_of('kind', kind, ('true', 'nan', 'sign', 'freeze', 'jump'))
    sim.disturbance.altitude = kind
    sim.disturbance.altitude_offset_m = float(offset_m)
    sim.disturbance.frozen_down_m = sim.flight.position_m[2]


@_fault
def barometer(sim: AutopilotSim, *, error_m: float = 0.0, rate_m_s: float = inf) -> None:
    """Let the barometer be wrong: the estimated height glides there, and the vehicle with it.

    Args:
        sim: The simulation.
        error_m: Reported minus true height; 0 ends it.
        rate_m_s: A drift at this rate, above 0; infinite: a step.
    """
    if not (isfinite(error_m) and rate_m_s > 0.0):
        raise VehicleError(
            f'fault barometer: error_m = {error_m} must be finite, rate_m_s = {rate_m_s} above 0'
        )
    sim.flight.barometer.become(float(error_m), float(rate_m_s))


@_fault
def frame(sim: AutopilotSim, *, kind: str = 'ned') -> None:
    """Report LOCAL_POSITION_NED in a wrong frame.

    Args:
        sim: The simulation.
        kind: ``ned`` ends it; ``enu`` (x east, y north, z up); ``msl`` (z below sea level instead
            of below home); ``south`` (x and y negated).
    """
    _one_of('kind', kind, ('ned', 'enu', 'msl', 'south'))
    sim.disturbance.frame = kind


@_fault
def position(sim: AutopilotSim, *, north_m: float = 0.0, east_m: float = 0.0) -> None:
    """Let the reported position jump by an offset (an EKF reset); zero ends it."""
    sim.disturbance.position_offset_m = (float(north_m), float(east_m))


@_fault
def telemetry_stop(sim: AutopilotSim, *, messages: tuple[str, ...] | list[str] = ()) -> None:
    """Stop some or all messages of the autopilot; commands are still obeyed and answered.

    Args:
        sim: The simulation.
        messages: MAVLink names such as ``HEARTBEAT``; empty: every one, COMMAND_ACK too.
    """
    sim.disturbance.muted = frozenset(messages) or frozenset({'*'})


@_fault
def telemetry_resume(sim: AutopilotSim) -> None:
    """End ``telemetry_stop``."""
    sim.disturbance.muted = frozenset()


@_fault
def silence(sim: AutopilotSim, *, seconds: float = 0.0) -> None:
    """Cut the MAVLink line in both directions.

    Args:
        sim: The simulation.
        seconds: Wall time after which the line works again; 0: until ``mend``.
    """
    sim.disturbance.silent_until_s = time.monotonic() + seconds if seconds > 0.0 else float('inf')


@_fault
def mend(sim: AutopilotSim) -> None:
    """End ``silence`` and ``line``."""
    calm = Disturbance()
    for name in ('silent_until_s', 'drop', 'duplicate', 'reorder', 'corrupt'):
        setattr(sim.disturbance, name, getattr(calm, name))


@_fault
def line(
    sim: AutopilotSim,
    *,
    drop: float = 0.0,
    duplicate: float = 0.0,
    reorder: float = 0.0,
    corrupt: float = 0.0,
) -> None:
    """Make the line bad in both directions; each is a probability per datagram, 0 to 1."""
    shares = {'drop': drop, 'duplicate': duplicate, 'reorder': reorder, 'corrupt': corrupt}
    for name, value in shares.items():
        if not 0.0 <= value <= 1.0:
            raise VehicleError(f'fault line: {name} = {value} must lie between 0 and 1')
        setattr(sim.disturbance, name, float(value))


@_fault
def reboot(sim: AutopilotSim, *, in_the_air: bool = True) -> None:
    """Restart the autopilot: boot time, intervals, mode and arming are reset.

    Args:
        sim: The simulation.
        in_the_air: It comes up armed, as after a watchdog reset in flight; otherwise the motors
            stop and the vehicle falls.
    """
    sim.reboot(keep_armed=in_the_air)


@_fault
def boot_clock(sim: AutopilotSim, *, step_s: float) -> None:
    """Let the autopilot's own clock (time_boot_ms, TIMESYNC) step without a reboot."""
    sim.disturbance.clock_step_s += float(step_s)


@_fault
def refuse(
    sim: AutopilotSim, *, modes: tuple[str, ...] | list[str], silently: bool = False
) -> None:
    """Refuse these modes to who asks over MAVLink (COMMAND_ACK and STATUSTEXT); not to the pilot.

    Args:
        sim: The simulation.
        modes: Names such as ``GUIDED``; empty ends it.
        silently: No answer at all instead.
    """
    sim.disturbance.refused_modes = frozenset(modes)
    sim.disturbance.refuse_silently = bool(silently)


@_fault
def pilot_mode(sim: AutopilotSim, *, mode: str) -> Answer:
    """Move the pilot's mode switch; answers ``accepted``."""
    return {'accepted': sim.pilot_mode(mode)}


@_fault
def yaw_stick(sim: AutopilotSim, *, deg_s: float) -> None:
    """Hold the pilot's yaw stick; 0 lets go."""
    sim.pilot_yaw_stick(radians(deg_s))


@_fault
def throttle_stick(sim: AutopilotSim, *, stick: float) -> None:
    """Hold the pilot's throttle stick, -1 (down) to 1 (up); 0 holds the height."""
    if not -1.0 <= stick <= 1.0:
        raise VehicleError(f'fault throttle_stick: stick = {stick} must lie between -1 and 1')
    sim.pilot_throttle_stick(float(stick))


@_fault
def radio_loss(sim: AutopilotSim) -> None:
    """Lose the pilot's radio: RTL."""
    sim.lose_radio()


@_fault
def wind(
    sim: AutopilotSim,
    *,
    to_north_m_s: float = 0.0,
    to_east_m_s: float = 0.0,
    gust_m_s: float = 0.0,
) -> None:
    """Set the mean wind, the way the air moves, and the standard deviation of the gusts."""
    sim.flight.physics.set_wind((float(to_north_m_s), float(to_east_m_s)), float(gust_m_s))


@_fault
def fence(
    sim: AutopilotSim,
    *,
    kind: str,
    at_m: float = 0.0,
    north_m: float = 0.0,
    east_m: float = 0.0,
    around_vehicle: bool = False,
) -> None:
    """Enable a fence: ArduPilot stops the vehicle 2 m before it, silently; PX4 holds beyond it.

    Args:
        sim: The simulation.
        kind: ``none`` ends it; ``floor`` (least altitude), ``ceiling``, ``circle``.
        at_m: Altitude above home, or radius.
        north_m: Of the centre of the circle.
        east_m: Of the centre of the circle.
        around_vehicle: The centre is where the vehicle is now; the other two are added.
    """
    _one_of('kind', kind, tuple(each.value for each in FenceKind))
    here = sim.flight.position_m if around_vehicle else (0.0, 0.0)
    centre_m = (here[0] + float(north_m), here[1] + float(east_m))
    sim.flight.fence = Fence(FenceKind(kind), float(at_m), centre_m)


@_fault
def commander(
    sim: AutopilotSim,
    *,
    rate_hz: float = 50.0,
    v_north_m_s: float = 0.0,
    v_east_m_s: float = 0.0,
    v_down_m_s: float = 0.0,
) -> None:
    """Let somebody else send velocity set-points too; a rate of 0 ends it."""
    velocity = (float(v_north_m_s), float(v_east_m_s), float(v_down_m_s))
    sim.flight.commander = SecondCommander(velocity, float(rate_hz))


@_fault
def battery(sim: AutopilotSim, *, remaining: float, failsafe: str = '') -> None:
    """Set the charge, 0 to 1; below 0.2 a STATUSTEXT warns once, and BATTERY_STATUS says LOW.

    Args:
        sim: The simulation.
        remaining: Charge.
        failsafe: Mode that the autopilot is configured to enter below 0.2, such as ``RTL``; empty:
            none, which is the default of ArduCopter and PX4.
    """
    if not 0.0 <= remaining <= 1.0:
        raise VehicleError(f'fault battery: remaining = {remaining} must lie between 0 and 1')
    mode = sim.flight.personality.mode_of_name(failsafe) if failsafe else None
    sim.flight.set_battery(float(remaining), mode)


@_fault
def text(sim: AutopilotSim, *, text: str, severity: int = 4) -> None:
    """Say a STATUSTEXT; severity is MAV_SEVERITY."""
    sim.flight.say(int(severity), str(text))


@_fault
def disarm(sim: AutopilotSim) -> None:
    """Stop the motors wherever the vehicle is."""
    sim.flight.disarm(force=True)


@_fault
def state(sim: AutopilotSim) -> Answer:
    """Return where the vehicle truly is and what it does; changes nothing."""
    flight = sim.flight
    truth = sim.truth()
    north, east, down = flight.physics.velocity_ned_m_s
    return {
        'time_s': sim.time_ns / 1e9,
        'mode': sim.mode_name,
        'mode_changes': flight.mode_changes,
        'armed': flight.armed,
        'landed': flight.landed,
        'has_position': flight.has_position,
        'north_m': truth.north_m,
        'east_m': truth.east_m,
        'altitude_agl_m': truth.altitude_agl_m,
        'v_north_m_s': north,
        'v_east_m_s': east,
        'v_down_m_s': down,
        'heading_rad': flight.physics.yaw_rad,
        'setpoint_age_s': flight.setpoint_age_s,
        'setpoints': flight.setpoints,
        'setpoints_refused': flight.setpoints_refused,
        'touchdown_speed_m_s': flight.physics.touchdown_speed_m_s,
        'lowest_agl_m': None if isinf(sim.lowest_agl_m) else sim.lowest_agl_m,
        'battery_remaining': flight.battery_remaining,
    }


def _one_of(name: str, value: str, choices: tuple[str, ...]) -> None:
    if value not in choices:
        raise VehicleError(f'{name} = {value!r}: choose one of {", ".join(choices)}')


def _arguments(function: Callable[..., Any]) -> str:
    names = [
        each.name
        for each in signature(function).parameters.values()
        if each.kind is Parameter.KEYWORD_ONLY
    ]
    return ', '.join(names) or 'no arguments'
