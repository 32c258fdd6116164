# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What the simulated autopilot knows of its position, and from whom: GPS or external navigation."""

from __future__ import annotations

from peace_ros.simulation.autopilot.navigation import FRESH_S, ExternalNavigation, Plane

ORIGIN_S = 20.0
"""When the filter sets its origin from GPS, on the autopilot's clock."""
READY_S = 42.0
"""When GPS and the pre-arm checks are ready."""
RECKONS_S, RECKONS_PX4_S = 7.1, 5.4
"""How long LOCAL_POSITION_NED goes on by dead reckoning after the loss of GNSS (measured:
ArduCopter 4.7-dev and PX4 v1.17-alpha); the flags of the filter stay as they were."""
DRIFT_M_S = 0.07
"""Of dead reckoning: right to 0.5 m after 7.1 s (measured: ArduCopter 4.7-dev)."""
FAILSAFE_S = 0.8
"""From the end of dead reckoning to the EKF failsafe."""

GPS_SOURCE = 1
EXTERNAL_SOURCE = 2


class Estimator:
    """Keeps account of the sources of position; the numbers come from the physics.

    Args:
        reckons_s: How long a lost source is bridged.
        navigation: The filter while it flies by external navigation.
        chooses: It takes external navigation by itself when GNSS is lost, and GNSS when it is
            back (PX4); otherwise the source is chosen by a command.
    """

    def __init__(
        self,
        reckons_s: float = RECKONS_S,
        navigation: ExternalNavigation | None = None,
        *,
        chooses: bool = False,
    ) -> None:
        self._reckons_s = reckons_s
        self._chooses = chooses
        self.navigation = navigation or ExternalNavigation(reckons_s=reckons_s)
        self.gps = True
        self.source = GPS_SOURCE
        self.stale_position = False
        self._reckoned_m = 0.0
        """Error of dead reckoning, to the north."""
        self._origin_given = False
        self._time_s = 0.0
        self._vision_s: float | None = None
        self._lost_s: float | None = None
        self._aided_s: float | None = None
        """When GNSS last gave a position."""

    @property
    def offset_m(self) -> Plane:
        """Position, estimate minus truth."""
        if self.source == EXTERNAL_SOURCE:
            return self.navigation.position_m
        return self._reckoned_m, 0.0

    @property
    def velocity_offset_m_s(self) -> Plane:
        """Velocity, estimate minus truth."""
        return self.navigation.velocity_m_s if self.source == EXTERNAL_SOURCE else (0.0, 0.0)

    def tilt_offset_rad(self, yaw_rad: float) -> tuple[float, float]:
        """Return roll and pitch, estimate minus truth, of a vehicle with a heading."""
        flies_by_it = self.source == EXTERNAL_SOURCE
        return self.navigation.tilt_rad(yaw_rad) if flies_by_it else (0.0, 0.0)

    def has_origin(self, time_s: float) -> bool:
        """The local frame exists."""
        started = self._aided_s is not None
        return self._origin_given or (self.gps and time_s >= ORIGIN_S) or started

    def has_position(self, time_s: float) -> bool:
        """Modes that need a position may be used."""
        if not self.has_origin(time_s):
            return False
        if self.source == EXTERNAL_SOURCE:
            return self.navigation.has_position(time_s)
        return self._is_aided(time_s) or self._reckons(time_s)

    def _is_aided(self, time_s: float) -> bool:
        return self.gps and time_s >= READY_S

    def _reckons(self, time_s: float) -> bool:
        if self._aided_s is None or self.stale_position:
            return False
        return self._lost_s is None or time_s - self._lost_s <= self._reckons_s

    def reports_position(self, time_s: float) -> bool:
        """LOCAL_POSITION_NED is sent."""
        if self.source == GPS_SOURCE and self.gps:
            return self.has_origin(time_s)
        stale = self.stale_position and self._aided_s is not None
        return self.has_position(time_s) or stale

    def give_origin(self) -> None:
        """Take SET_GPS_GLOBAL_ORIGIN."""
        self._origin_given = True

    def see(self, time_s: float, seen_m: Plane, resets: int = 0) -> None:
        """Take a position (north, east); only the barometer gives the height."""
        self._vision_s = time_s
        if self.source == EXTERNAL_SOURCE:
            self.navigation.see_position(time_s, seen_m, resets)

    def see_velocity(self, time_s: float, seen_m_s: Plane) -> None:
        """Take a velocity (north, east)."""
        if self.source == EXTERNAL_SOURCE:
            self.navigation.see_velocity(time_s, seen_m_s)

    def use_source(self, source: int) -> bool:
        """Switch the source set (1: GPS, 2: external navigation); False for other numbers."""
        if source not in {GPS_SOURCE, EXTERNAL_SOURCE}:
            return False
        if source == self.source:
            return True
        if source == EXTERNAL_SOURCE:
            self.navigation.begin(self._time_s, self.offset_m, aided_s=self._aided_s)
        elif self.navigation.has_position(self._time_s) and not self.gps:
            # Without GNSS the position is carried on from here.
            self._aided_s = self._lost_s = self._time_s
        self.source, self._reckoned_m = source, 0.0
        return True

    def step(self, time_s: float, truth_m: Plane, truth_m_s: Plane) -> bool:
        """Advance to a moment, at which position and velocity are truly these.

        Returns:
            The position has been lost for too long: EKF failsafe.
        """
        self._time_s = time_s
        if self._chooses:
            self._choose(time_s)
        if self._is_aided(time_s):
            self._aided_s, self._lost_s, self._reckoned_m = time_s, None, 0.0
        elif self._lost_s is None:
            self._lost_s = self._aided_s
        if self.source == EXTERNAL_SOURCE:
            return self._navigate(time_s, truth_m, truth_m_s)
        if self._lost_s is None:
            return False
        lost_s = time_s - self._lost_s
        if self._reckons(time_s):
            self._reckoned_m = DRIFT_M_S * lost_s
        return lost_s >= self._reckons_s + FAILSAFE_S

    def _navigate(self, time_s: float, truth_m: Plane, truth_m_s: Plane) -> bool:
        self.navigation.step(time_s, truth_m, truth_m_s)
        if self.navigation.is_unsure:
            return True
        known_s = self.navigation.known_s
        return known_s is not None and time_s - known_s > FAILSAFE_S

    def _choose(self, time_s: float) -> None:
        flows = self._vision_s is not None and time_s - self._vision_s <= FRESH_S
        if self.gps:
            self.use_source(GPS_SOURCE)
        elif flows:
            self.use_source(EXTERNAL_SOURCE)
