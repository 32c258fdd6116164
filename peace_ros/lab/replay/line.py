# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""All cores in one thread, in the order of the stamps: same recording, same answer."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Iterator
from dataclasses import dataclass

from peace_ros.core.domain import Camera, Frame, Mount, Pose, Telemetry
from peace_ros.core.domain.geometry import camera_pose, interpolate
from peace_ros.core.landing import Decision
from peace_ros.core.pipeline import Pipeline, SegmentedFrame, create_landing
from peace_ros.core.presets import Preset

STEP_NS = 100_000_000
"""The landing core decides at 10 Hz of recorded time."""
_MOST_GAP_NS = 60_000_000_000
"""Longer than any time limit of the landing but that of a whole search."""
_VELOCITY_SPAN_NS = 200_000_000
_MODE = 'REPLAY'


@dataclass(frozen=True)
class Step:
    """One decision of the landing core."""

    stamp_ns: int
    decision: Decision
    pose: Pose | None
    """The recorded pose that it rests on."""


class ReplayLine:
    """The pipeline and the landing core over recorded frames and poses.

    The vehicle is taken to be armed and obedient all the time; its poses are the recorded ones,
    so what the landing core commands has no effect.
    """

    def __init__(
        self,
        preset: Preset,
        camera: Camera,
        mount: Mount,
        poses: list[Pose],
        engage_ns: int | None,
        *,
        threads: int = 1,
    ) -> None:
        """Load the models.

        Args:
            preset: parameters of the three nodes.
            camera: that of frames that come without a calibration.
            mount: how the camera sits on the vehicle.
            poses: in the order of their stamps.
            engage_ns: when the landing begins; None: with the first frame.
            threads: CPU threads of the networks; only 1 gives the same sums on every machine.

        Raises:
            PeaceError: parameters, terms, vocabularies or bundles cannot be used.
        """
        self.pipeline = Pipeline.from_preset(preset, threads=threads)
        self.landing = create_landing(preset, camera, mount)
        self._mount = mount
        self._poses = poses
        self._stamps = [pose.stamp_ns for pose in poses]
        self._fed = 0
        self._engage_ns = engage_ns
        self._engaged = False
        self._now_ns: int | None = None

    def look(self, frame: Frame) -> SegmentedFrame:
        """Run the networks on a frame and give the heatmap to the landing core.

        Raises:
            PeaceError: there is no heatmap of this frame, nor would there be in flight.
        """
        look = self.pipeline.look(frame)
        self._feed_poses(frame.stamp_ns)
        self.landing.add_view(frame)
        self.landing.add_heatmap(look.heatmap)
        return look

    def skip_gap(self, stamp_ns: int) -> float:
        """Go on at a stamp when there is none for long before it; return the gap in seconds.

        A clock that jumps would be filled with decisions about nothing, for years if need be.
        """
        if self._now_ns is None or stamp_ns - self._now_ns <= _MOST_GAP_NS:
            return 0.0
        gap_s = (stamp_ns - self._now_ns) * 1e-9
        self._now_ns = stamp_ns
        return gap_s

    def steps_until(self, stamp_ns: int) -> Iterator[Step]:
        """Yield the decisions that fall due up to a stamp."""
        if self._now_ns is None:
            self._now_ns = stamp_ns
        while self._now_ns <= stamp_ns:
            now_ns = self._now_ns
            if not self._engaged and now_ns >= (self._engage_ns or 0):
                self.landing.engage()
                self._engaged = True
            self._feed_poses(now_ns)
            pose, age_s = self._pose_before(now_ns)
            decision = self.landing.step(now_ns, self._telemetry(now_ns, pose), age_s)
            yield Step(now_ns, decision, pose)
            self._now_ns = now_ns + STEP_NS

    def camera_pose_at(self, stamp_ns: int) -> Pose | None:
        """Return the pose of the camera between two recorded ones, None outside of them."""
        index = bisect_right(self._stamps, stamp_ns)
        if not 0 < index < len(self._poses):
            return None
        before, after = self._poses[index - 1 : index + 1]
        return camera_pose(self._mount, interpolate(before, after, stamp_ns))

    def _feed_poses(self, stamp_ns: int) -> None:
        """Give the landing core every pose up to the first that is not before the stamp."""
        while self._fed < len(self._poses):
            pose = self._poses[self._fed]
            self.landing.add_pose(pose)
            self._fed += 1
            if pose.stamp_ns >= stamp_ns:
                return

    def _pose_before(self, now_ns: int) -> tuple[Pose | None, float]:
        index = bisect_right(self._stamps, now_ns) - 1
        if index < 0:
            return None, 0.0
        pose = self._poses[index]
        return pose, (now_ns - pose.stamp_ns) * 1e-9

    def _telemetry(self, now_ns: int, pose: Pose | None) -> Telemetry:
        before, _ = self._pose_before(now_ns - _VELOCITY_SPAN_NS)
        north = east = down = 0.0
        if pose is not None and before is not None and pose.stamp_ns > before.stamp_ns:
            span_s = (pose.stamp_ns - before.stamp_ns) * 1e-9
            north = (pose.north_m - before.north_m) / span_s
            east = (pose.east_m - before.east_m) / span_s
            down = (pose.down_m - before.down_m) / span_s
        return Telemetry(
            received_ns=now_ns,
            pose=pose,
            v_north_m_s=north,
            v_east_m_s=east,
            v_down_m_s=down,
            armed=True,
            in_control=True,
            mode=_MODE,
            landed=False,
        )
