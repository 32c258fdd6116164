# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""How long set-points go on after somebody else took over, as the autopilot receives them.

``python -m peace_ros.lab.evaluation.takeovers --repeat 2`` flies the simulated autopilots over UDP
in real time: the sender is told 1 m/s all the time, the mode changes at the autopilot, and the last
set-point that arrives is timed.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from peace_ros.core.domain import Setpoint, VehicleError
from peace_ros.core.vehicle import SetpointSender, VehicleParameters, open_vehicle
from peace_ros.simulation.autopilot import AutopilotParameters, AutopilotSim

LIMIT_S = 0.3
MODES: dict[str, tuple[str, ...]] = {
    'ardupilot': ('LOITER', 'RTL', 'LAND', 'BRAKE', 'ALT_HOLD'),
    'px4': ('POSCTL', 'AUTO.RTL', 'AUTO.LAND', 'AUTO.LOITER', 'ALTCTL'),
}
ALTITUDE_M = 50.0
_BOOT_S = 45.0
_TAKE_OFF_S = 120.0
_STEP_S = 0.1
_BEFORE_S, _AFTER_S = 1.0, 1.5
_POLL_S = 0.002
_MOVING = Setpoint(0, v_north_m_s=1.0)


@dataclass(frozen=True)
class Takeover:
    """One change of the mode by somebody else."""

    autopilot: str
    mode: str
    last_s: float
    """From the change to the last set-point that arrived; 0 when none did."""
    noticed: bool
    """The companion says that somebody took over."""

    @property
    def holds(self) -> bool:
        """It was noticed, and set-points ended in time."""
        return self.noticed and self.last_s <= LIMIT_S


def take_over(autopilot: str, mode: str) -> Takeover:
    """Fly until somebody changes the mode.

    Raises:
        VehicleError: The vehicle does not take off, or refuses control or the mode.
    """
    with AutopilotSim(AutopilotParameters(port=0, autopilot=autopilot)) as sim:
        _lift(sim)
        link = open_vehicle(sim.url, parameters=VehicleParameters())
        sender = SetpointSender(link)
        sender.start()
        try:
            sender.submit(Setpoint(0))
            if not (answer := link.request_control(by_person=True)):
                raise VehicleError(f'the simulated {autopilot} refuses control: {answer.reason}')
            _last_setpoint_s(sim, sender, _BEFORE_S)
            if not sim.pilot_mode(mode):
                raise VehicleError(f'the simulated {autopilot} refuses mode {mode}')
            last_s = _last_setpoint_s(sim, sender, _AFTER_S)
            return Takeover(autopilot, mode, last_s, link.taken_over)
        finally:
            sender.stop()
            link.close()


def _lift(sim: AutopilotSim) -> None:
    """Bring the vehicle into the air, faster than its clock."""
    with sim.lock:
        sim.step(_BOOT_S)
        flight = sim.flight
        above_m = sim.parameters.home_altitude_msl_m if flight.personality.is_px4 else 0.0
        sim.pilot_mode('STABILIZED' if flight.personality.is_px4 else 'GUIDED')
        flight.arm()
        flight.take_off(ALTITUDE_M + above_m)
        until_s = flight.time_s + _TAKE_OFF_S
        while flight.landed_state.name != 'IN_AIR':
            if flight.time_s > until_s:
                raise VehicleError(f'no take-off within {_TAKE_OFF_S:g} s of simulated time')
            sim.step(_STEP_S)


def _last_setpoint_s(sim: AutopilotSim, sender: SetpointSender, seconds: float) -> float:
    """Renew the decision for a while; return when the last set-point arrived meanwhile."""
    begin_s, count, last_s = time.monotonic(), sim.flight.setpoints, 0.0
    while (now_s := time.monotonic() - begin_s) < seconds:
        sender.submit(_MOVING)
        if sim.flight.setpoints != count:
            count, last_s = sim.flight.setpoints, now_s
        time.sleep(_POLL_S)
    return last_s


def measure(repeat: int) -> Iterator[Takeover]:
    """Take over in each mode of each autopilot, so often."""
    for autopilot, modes in MODES.items():
        for mode in modes * repeat:
            yield take_over(autopilot, mode)


def main(args: Sequence[str] | None = None) -> int:
    """Measure from the command line; 1 when a limit does not hold."""
    parser = argparse.ArgumentParser(
        prog='python -m peace_ros.lab.evaluation.takeovers',
        description=(__doc__ or '').splitlines()[0],
    )
    parser.add_argument('--repeat', type=int, default=2, help='of each mode')
    found = []
    for each in measure(parser.parse_args(args).repeat):
        found.append(each)
        noticed = '' if each.noticed else '  NOT NOTICED'
        sys.stdout.write(
            f'{each.autopilot:9s}  {each.mode:11s}  last set-point after {each.last_s:.3f} s'
            f'{noticed}\n'
        )
        sys.stdout.flush()
    held = sum(each.holds for each in found)
    slowest_s = max((each.last_s for each in found), default=0.0)
    sys.stdout.write(
        f'{held} of {len(found)} within {LIMIT_S:g} s; the last one after {slowest_s:.3f} s\n'
    )
    return 0 if found and held == len(found) else 1


if __name__ == '__main__':
    sys.exit(main())
