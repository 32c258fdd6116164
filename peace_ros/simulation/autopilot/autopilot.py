# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""AutopilotSim: a vehicle that flies on its own clock and speaks MAVLink."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from math import radians
from typing import final

from peace_ros.core.domain.errors import VehicleError
from peace_ros.core.domain.motion import Pose
from peace_ros.simulation.autopilot.disturbance import Disturbance
from peace_ros.simulation.autopilot.estimate_errors import (
    ErrorSizes,
    EstimateErrors,
    GnssAltitudeError,
)
from peace_ros.simulation.autopilot.fault_port import FaultServer
from peace_ros.simulation.autopilot.flight import Flight
from peace_ros.simulation.autopilot.modes import Result
from peace_ros.simulation.autopilot.parameter_store import ParameterStore
from peace_ros.simulation.autopilot.parameters import AutopilotParameters
from peace_ros.simulation.autopilot.personality import Kind, Personality
from peace_ros.simulation.autopilot.physics import Physics
from peace_ros.simulation.autopilot.server import MavlinkServer

LOOP_S = 0.004
"""Wall time between two turns of the loop."""
MAX_TURN_S = 0.1
"""Wall time that one turn answers for at most; the rest is made up for gradually."""
CATCH_UP = 1.5
"""How much faster than ``speed`` the simulated clock runs while it is behind."""
MAX_LAG_S = 2.0
"""Wall time that is made up for; beyond it the simulated clock stays behind."""
_FLYING_M = 5.0


@final
class AutopilotSim:
    """Physics, state machine and MAVLink server of one simulated vehicle.

    Either :meth:`step` it (deterministic, no thread) or let :meth:`start` run it in a thread.
    The pilot's verbs may be called from any thread.

    Args:
        parameters: Everything that a user may choose.

    Raises:
        VehicleError: The UDP port is taken.
    """

    def __init__(self, parameters: AutopilotParameters | None = None) -> None:
        self.parameters = parameters or AutopilotParameters()
        self.lock = threading.RLock()
        """Held while the simulation steps, and while a fault is put in."""
        self.disturbance = Disturbance()
        self.lowest_agl_m = float('inf')
        """Since it first was above 5 m; infinite before."""
        self._personality = Personality(Kind(self.parameters.autopilot))
        self._parameter_store = ParameterStore(self._personality, self.parameters.system_id)
        self._stop = threading.Event()
        self._thread: threading.Thread | None = None
        self._clock_offset_s = 0.0
        self._remainder_s = 0.0
        self._server = MavlinkServer(self.parameters, self._personality, self.disturbance)
        self._faults: FaultServer | None = None
        if self.parameters.fault_port > 0:
            try:
                self._faults = FaultServer(self.parameters.fault_port)
            except VehicleError:
                self._server.close()
                raise
        self._flight = self._power_on()

    def __enter__(self) -> AutopilotSim:
        self.start()
        return self

    def __exit__(self, *_error: object) -> None:
        self.close()

    @property
    def url(self) -> str:
        """Where a companion connects to."""
        return f'udpout:{self.parameters.host}:{self._server.port}'

    def call(self, host: str, port: int) -> None:
        """Send to a ground station that listens on UDP and has not spoken yet."""
        with self.lock:
            self._server.call((host, port))

    @property
    def time_ns(self) -> int:
        """Simulated clock; a reboot of the autopilot does not reset it."""
        with self.lock:
            return round((self._clock_offset_s + self._flight.time_s) * 1e9)

    @property
    def tcp_url(self) -> str:
        """Where a companion connects to by TCP; empty when there is no such port."""
        port = self.parameters.tcp_port or self.parameters.serial_port
        return f'tcp:{self.parameters.host}:{port}' if port else ''

    @property
    def refused_signatures(self) -> int:
        """Messages that were not signed with its key."""
        return self._server.refused_signatures

    @property
    def mode_name(self) -> str:
        """The autopilot's own name of its mode."""
        return self._personality.mode_name(self._flight.mode)

    @property
    def flight(self) -> Flight:
        """The state machine, for looking at."""
        return self._flight

    def truth(self) -> Pose:
        """Return where the vehicle really is, relative to home, at the simulated clock."""
        with self.lock:
            p = self._flight.physics
            return Pose(
                stamp_ns=self.time_ns,
                north_m=p.north_m,
                east_m=p.east_m,
                down_m=p.down_m,
                quaternion_ned_frd=p.quaternion_ned_frd,
                altitude_agl_m=max(0.0, -p.down_m),
            )

    def step(self, dt_s: float) -> None:
        """Serve the peers and advance the simulated clock by dt_s in steps of the physics."""
        tick = 1.0 / self.parameters.physics_rate_hz
        with self.lock:
            if self._faults is not None:
                self._faults.poll(self)
            self._server.receive(self._flight)
            if self._server.waits_for_client:
                return
            self._remainder_s += dt_s
            while self._remainder_s >= tick - 1e-9:
                self._remainder_s -= tick
                self._flight.step(tick)
                self._server.send_due(self._flight)
                self._note_altitude()

    def run(
        self,
        stop: threading.Event | None = None,
        on_step: Callable[[AutopilotSim], None] | None = None,
    ) -> None:
        """Follow the wall clock times ``speed`` until stopped.

        Args:
            stop: Ends the loop when set; None: only :meth:`close` ends it.
            on_step: Called after every turn of the loop (every 4 ms of wall time or more).
        """
        last = time.monotonic()
        lag_s = 0.0
        while not self._stop.is_set() and not (stop is not None and stop.is_set()):
            now = time.monotonic()
            lag_s = min(lag_s + now - last, MAX_LAG_S)
            turn_s = min(lag_s, CATCH_UP * min(now - last, MAX_TURN_S))
            lag_s -= turn_s
            last = now
            self.step(turn_s * self.parameters.speed)
            if on_step is not None:
                on_step(self)
            self._server.wait(LOOP_S - (time.monotonic() - now))
            time.sleep(max(0.0, LOOP_S / 2 - (time.monotonic() - now)))

    def start(self) -> None:
        """Run in a thread of its own."""
        if self._thread is None:
            self._thread = threading.Thread(target=self.run, name='autopilot_sim', daemon=True)
            self._thread.start()

    def close(self) -> None:
        """Stop the thread and release the port."""
        self._stop.set()
        if self._thread is not None:
            self._thread.join(timeout=5.0)
        self._server.close()
        if self._faults is not None:
            self._faults.close()

    def pilot_mode(self, mode: str) -> bool:
        """Move the pilot's mode switch; tell whether the autopilot took the mode."""
        with self.lock:
            wanted = self._personality.mode_of_name(mode)
            return self._flight.set_mode(wanted) is Result.ACCEPTED

    def pilot_yaw_stick(self, yaw_rate_rad_s: float) -> None:
        """Hold the yaw stick: it turns the vehicle in GUIDED too."""
        with self.lock:
            self._flight.turn_stick(yaw_rate_rad_s)

    def pilot_throttle_stick(self, stick: float) -> None:
        """Hold the throttle stick, -1 (down) to 1 (up): LOITER climbs and sinks with it."""
        with self.lock:
            self._flight.move_throttle(stick)

    def lose_gps(self, *, stale: bool = False) -> None:
        """Take GPS away; LOCAL_POSITION_NED stops, or continues with old numbers when ``stale``."""
        with self.lock:
            self._flight.lose_gps(stale=stale)

    def restore_gps(self) -> None:
        """Give GPS back."""
        with self.lock:
            self._flight.restore_gps()

    def lose_radio(self) -> None:
        """Take the pilot's radio away: RTL."""
        with self.lock:
            self._flight.lose_radio()

    def silence(self, *, silent: bool = True) -> None:
        """Cut the MAVLink line in both directions, or restore it."""
        with self.lock:
            self.disturbance.silent_until_s = float('inf') if silent else 0.0

    def reboot(self, *, keep_armed: bool = False) -> None:
        """Restart the autopilot where the vehicle is: its boot time begins at zero again.

        Args:
            keep_armed: Come up armed when it was, as after a watchdog reset in flight.
        """
        with self.lock:
            armed = keep_armed and self._flight.armed
            battery = self._flight.battery_remaining
            self._clock_offset_s += self._flight.time_s
            self._flight = self._boot(self._flight.physics)
            self._flight.battery_remaining = battery
            self._flight.revive(armed=armed)
            self._server.restart()

    def _boot(self, physics: Physics) -> Flight:
        p, measured = self.parameters, self._personality.errors
        bias, noise = p.velocity_bias_m_s, p.position_noise_m
        sizes = ErrorSizes(
            velocity_bias_m_s=measured.velocity_bias_m_s if bias < 0.0 else bias,
            position_noise_m=measured.position_noise_m if noise < 0.0 else noise,
        )
        errors = EstimateErrors(sizes, p.seed)
        gnss = GnssAltitudeError(p.gnss_altitude_noise_m, p.seed)
        return Flight(physics, self._personality, p.datum, errors, gnss, self._parameter_store)

    def _note_altitude(self) -> None:
        altitude_m = -self._flight.physics.down_m
        if altitude_m > _FLYING_M or self.lowest_agl_m < float('inf'):
            self.lowest_agl_m = min(self.lowest_agl_m, altitude_m)

    def _power_on(self) -> Flight:
        p = self.parameters
        physics = Physics(
            p.start_north_m,
            p.start_east_m,
            radians(p.start_heading_deg),
            wind_to_m_s=(p.wind_to_north_m_s, p.wind_to_east_m_s),
            gust_m_s=p.gust_m_s,
            seed=p.seed,
        )
        return self._boot(physics)
