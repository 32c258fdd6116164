# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The landing as one object: poses, heatmaps and telemetry in, decisions out; no clock, no thread.

Each step handles data, site, state, guidance and guard, in this order.
"""

from __future__ import annotations

from dataclasses import replace
from math import inf

from peace_ros.core.domain import (
    NADIR,
    Camera,
    DepthImage,
    Frame,
    Heatmap,
    HeightReport,
    Mount,
    Pose,
    Site,
    Telemetry,
)
from peace_ros.core.landing.decision import Decision
from peace_ros.core.landing.engagement import engagement_problem
from peace_ros.core.landing.guidance import over_site
from peace_ros.core.landing.heights import NO_OTHER_HEIGHT, HeightWatch
from peace_ros.core.landing.helm import Helm
from peace_ros.core.landing.intake import HeatmapIntake
from peace_ros.core.landing.lookout import Lookout
from peace_ros.core.landing.memory import FailedPlace
from peace_ros.core.landing.parameters import LandingParameters
from peace_ros.core.landing.situation import Sighting
from peace_ros.core.landing.states import State
from peace_ros.core.landing.watch import valid_pose
from peace_ros.core.mapping import MapParameters, SafetyMap

_NANOSECONDS = 1_000_000_000
_PICTURE_LIMIT_NS = 2 * _NANOSECONDS
"""Age at which a picture says nothing of the height."""
_JUMP_NS = _NANOSECONDS
"""A clock that goes back by more than this was restarted."""


class LandingCore:
    """Lands a vehicle on safe ground; not thread-safe.

    Times are nanoseconds of one clock, the clock of the stamps of poses and heatmaps.
    """

    def __init__(
        self,
        parameters: LandingParameters,
        camera: Camera,
        map_parameters: MapParameters | None = None,
        mount: Mount = NADIR,
        *,
        on_gimbal: bool = False,
    ) -> None:
        """Begin in IDLE.

        Args:
            parameters: Of the landing.
            camera: For frames that come without a calibration of their own.
            map_parameters: Of the map.
            mount: How the camera sits on the vehicle.
            on_gimbal: The camera sits on a gimbal, which telemetry reports, and on it as ``mount``.
        """
        self.parameters = parameters
        self.safety_map = SafetyMap(map_parameters)
        self._intake = HeatmapIntake(
            parameters, camera, self.safety_map, mount, on_gimbal=on_gimbal
        )
        self._lookout = Lookout(parameters, self.safety_map)
        self._heights = HeightWatch(parameters)
        self._height_sight = NO_OTHER_HEIGHT
        self._helm = Helm(parameters)
        self._last_ns: int | None = None
        self._drops = 0

    @property
    def state(self) -> State:
        """The state that the last step ended in."""
        return self._helm.state

    def map_age_s(self, now_ns: int) -> float:
        """Return the age of the newest heatmap in the map, infinite without one."""
        stamp_ns = self.safety_map.stamp_ns
        return inf if stamp_ns is None else (now_ns - stamp_ns) / _NANOSECONDS

    @property
    def failed_places(self) -> tuple[FailedPlace, ...]:
        """Circles in which no site is chosen now."""
        return self._lookout.memory.failed

    @property
    def seen_sites(self) -> tuple[Site, ...]:
        """Every other site that was seen, as it was seen last."""
        return self._lookout.memory.seen

    @property
    def search_path(self) -> tuple[tuple[float, float], ...]:
        """Way-points (north, east) of the search while a site is looked for, else none."""
        return self._helm.search_path

    @property
    def last_rejection(self) -> str:
        """Why the newest heatmap did not reach the map, or why the map was dropped."""
        return self._intake.last_rejection

    def add_pose(self, pose: Pose, mount: Mount | None = None) -> None:
        """Keep a pose for the heatmaps around its stamp; in the order of stamps.

        Args:
            pose: Of the vehicle.
            mount: Of the camera at that moment, where it moves.
        """
        self._intake.add_pose(pose, mount)

    def add_heatmap(self, heatmap: Heatmap) -> None:
        """Put a heatmap into the map with the pose at its stamp, or count the reason why not."""
        self._intake.add_heatmap(heatmap)

    def reject_heatmap(self, reason: str) -> None:
        """Count a heatmap that cannot be used, and remember why."""
        self._intake.reject(reason)

    def distrust(self, reason: str) -> None:
        """Hold, drop the map and use no input while there is a reason; empty: use them again."""
        self._intake.distrust(reason)

    def add_depth(self, depth: DepthImage) -> None:
        """Close ground that a depth image shows not flat; optional, and it opens nothing."""
        self._intake.add_depth(depth)

    def add_view(self, frame: Frame) -> None:
        """Keep the picture of a frame: for the height, and for a position that is missing."""
        self._intake.add_view(frame)

    def engage(self) -> None:
        """Begin a landing, also after one that ended in ABORTED, HANDOVER or HOLD."""
        self._lookout.begin()
        self._heights.begin()
        self._intake.picture_height.begin()
        self._helm.engage()

    def engagement_problem(
        self, now_ns: int, telemetry: Telemetry | None, telemetry_age_s: float
    ) -> str:
        """Return why a landing cannot begin now, empty when it can; as for :meth:`step`."""
        return engagement_problem(
            self.state,
            telemetry,
            telemetry_age_s,
            self.map_age_s(now_ns),
            self.parameters,
            self.last_rejection,
            self._intake.distrusted,
        )

    def disengage(self) -> None:
        """Stop: zero velocity and IDLE from the next step on."""
        self._helm.disengage()

    def step(self, now_ns: int, telemetry: Telemetry | None, telemetry_age_s: float) -> Decision:
        """Decide what to do now.

        Args:
            now_ns: The clock of the stamps.
            telemetry: What the autopilot last said, None before it said anything.
            telemetry_age_s: Since it was received, by a steady clock.
        """
        self._keep_time(now_ns)
        self._intake.follow_gimbal(None if telemetry is None else telemetry.gimbal)
        self._intake.tick(now_ns)
        if self._intake.drops != self._drops:
            self._drops = self._intake.drops
            self._lookout.forget_choice()
        pose, before = valid_pose(telemetry, self.parameters), self._helm.state
        # The heights need to know whether a site is below: those of the step before are used.
        sighting = self._lookout.look(
            now_ns, pose, before, self._helm.without_site_s, self._height_sight.above_lowest_m
        )
        self._height_sight = heights = self._heights.see(
            now_ns,
            pose,
            self._height_reports(now_ns, telemetry, pose),
            over_site=self._is_over_site(pose, sighting),
        )
        decision = self._helm.decide(
            now_ns,
            telemetry,
            telemetry_age_s,
            sighting,
            self._intake.last_rejection,
            heights,
            self._intake.distrusted,
        )
        if decision.state is not before and self._lookout.follow(before, decision.state, now_ns):
            self._helm.fail_attempt()
        return replace(
            decision,
            counts=dict(self._intake.counts),
            failed_sites=self._lookout.failed_sites,
            attempts=self._helm.attempts,
            refused=self._lookout.refused,
        )

    def _height_reports(
        self, now_ns: int, telemetry: Telemetry | None, pose: Pose | None
    ) -> tuple[HeightReport, ...]:
        """Return the heights to compare with: those of the telemetry, and that of the pictures."""
        reports = () if telemetry is None else telemetry.heights
        by_picture = self._intake.picture_height
        if pose is None or by_picture.stamp_ns is None:
            return reports
        if now_ns - by_picture.stamp_ns > _PICTURE_LIMIT_NS:
            return reports
        height_m = pose.altitude_agl_m + by_picture.above_reported_m
        return (*reports, HeightReport('pictures', height_m, 0.0))

    def _is_over_site(self, pose: Pose | None, sighting: Sighting) -> bool:
        site = sighting.reachable
        radius_m = self.parameters.safety_radius_m
        return pose is not None and site is not None and over_site(pose, site, radius_m)

    def _keep_time(self, now_ns: int) -> None:
        """Forget everything when the clock jumps back (a restarted simulation)."""
        if self._last_ns is not None and now_ns < self._last_ns - _JUMP_NS:
            self.safety_map.clear()
            self._intake.clear()
            self._lookout.forget_choice()
            self._heights.begin()
            self._helm.restart_clock(now_ns)
        self._last_ns = now_ns
