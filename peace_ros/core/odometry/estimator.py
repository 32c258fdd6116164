# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Position and velocity of a vehicle from its camera, body rates and altitude, without GNSS.

Each picture is compared with a key frame, not with the one before, so that a vehicle that hovers
does not drift. Rotation and shift are solved together. Body rates predict the rotation; the
attitude of the autopilot is used once, when the odometry is aligned: an autopilot that flies on
vision makes its attitude from it, and an error would feed itself.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, replace
from math import hypot, isfinite, radians

import numpy as np
from numpy.typing import NDArray

from peace_ros.core.domain import (
    NADIR,
    Camera,
    Frame,
    Heatmap,
    InertialSample,
    MotionEstimate,
    Mount,
    Pose,
)
from peace_ros.core.domain.camera import Quaternion
from peace_ros.core.domain.geometry import (
    GRAVITY_M_S2,
    camera_pose,
    ground_to_camera,
    multiply,
    rotation_matrix,
)
from peace_ros.core.mapping import small_grey
from peace_ros.core.odometry.coherence import AccelerationCheck
from peace_ros.core.odometry.doubt import Doubt
from peace_ros.core.odometry.inertial import InertialHistory, InertialMotion
from peace_ros.core.odometry.keyframe import (
    Keyframe,
    Matches,
    Readout,
    build_keyframe,
    find,
)
from peace_ros.core.odometry.movable import ScoredView
from peace_ros.core.odometry.parameters import OdometryParameters
from peace_ros.core.odometry.plane import (
    LEAST_ERROR_PX,
    Array,
    PriorErrors,
    RelativePose,
    Solution,
    solve,
)
from peace_ros.core.odometry.velocity import PositionTrack, Velocity

VIEW_PX = 352
"""Longer edge of the pictures that are compared."""
_ONE_ABOVE = Pose(0, 0.0, 0.0, 0.0, (1.0, 0.0, 0.0, 0.0), 1.0)
"""A level vehicle one metre above the ground."""
_FEWEST = 15
"""Corners that must agree."""
_FEW = 30
"""With fewer corners the next key frame begins, if it has more."""
_LEAST_AGREEING = 0.4
"""Part of the corners in view that must agree."""
_NEW_KEY_AGREEING = 0.4
"""Part of the corners of the key frame below which the next one begins."""
_NEW_KEY_RATIO = 1.33
"""Change of the height after which the next key frame begins."""
_NEW_KEY_ERROR_PX = 0.15
"""Error of the corners above which the next key frame begins: hills then show, and their error
grows with the way from the key frame."""
_LARGEST_TURN = 4.0
"""Standard deviations by which pictures may turn the vehicle otherwise than its body rates."""
_LARGEST_ERROR_PX = 1.5
_NEAR_S, _LEVELS_WHEN_NEAR, _LEVELS = 0.3, 1, 3
"""The prediction is near for so long after a frame, and the search may then be short."""
_AGAIN_PX = 4.0
"""A place that is off by more is used to warp the picture once more."""
_LOST_S = 1.0
"""Without a place for so long a new key frame begins where the vehicle is believed to be."""
_LOST_M_S2 = 1.0
"""Error of the acceleration while there is no picture."""
_LEAST_SHIFT = 0.1
"""Heights: by errors of corners against a nearer key frame the relief is not estimated."""
_LOWEST_M = 1.0
_KEPT = 40
"""Frames for which a heatmap may still come."""
_LEAST_RATIO = 0.1
_VELOCITY_GAIN = 0.3
"""Of the prediction: part of what the position was off that is laid to the velocity."""
_SHARED_ERROR = 0.0005
"""Of a place in heights of the key frame: what its corners share, by lens and hills."""
_ALTITUDE_ERROR = 0.03
"""Of the altitude, and with it of the scale."""


@dataclass(frozen=True)
class _VehicleState:
    """Vehicle at the last frame: solved, or predicted from the last one that was."""

    stamp_ns: int
    quaternion: Quaternion
    position_m: Array
    """(3,) of the camera: north, east, down."""
    velocity_m_s: Array
    covariance_m2: Array
    """3 x 3, of the position."""
    solved_ns: int
    """When it was solved last."""

    @property
    def lost_s(self) -> float:
        """Since it was solved last."""
        return (self.stamp_ns - self.solved_ns) * 1e-9

    def change_m_s(self, stamp_ns: int, motion: InertialMotion) -> Array:
        """Return the change of the velocity (3,) up to a stamp: north, east, down."""
        change: Array = rotation_matrix(self.quaternion) @ motion.velocity_m_s
        change[2] += GRAVITY_M_S2 * (stamp_ns - self.stamp_ns) * 1e-9
        return change

    def after(self, stamp_ns: int, motion: InertialMotion) -> _VehicleState:
        """Return the state that body rates and accelerations predict."""
        span_s = (stamp_ns - self.stamp_ns) * 1e-9
        change = self.change_m_s(stamp_ns, motion)
        return _VehicleState(
            stamp_ns,
            multiply(self.quaternion, motion.turn),
            self.position_m + span_s * (self.velocity_m_s + 0.5 * change),
            self.velocity_m_s + change,
            self.covariance_m2,
            self.solved_ns,
        )


@dataclass(frozen=True)
class _SeenPicture:
    """A picture and what is known at its stamp."""

    grey: NDArray[np.uint8]
    camera: Camera
    mount: Array
    """3 x 3, axes of the camera from those of the vehicle."""
    height_m: float
    """Of the camera above the ground, as the autopilot reports it."""
    readout: Readout


@dataclass(frozen=True)
class _Key:
    frame: Keyframe
    camera: Camera
    position_m: Array
    """(3,) of the camera."""
    height_m: float
    """Of the camera above the ground."""
    covariance_m2: Array
    """3 x 3, of the position."""

    def without(self, seen: ScoredView | None, limit: float) -> _Key:
        """Return the key frame without the corners that a heatmap calls clearly unsafe."""
        if seen is None:
            return self
        ground_m = self.position_m + self.height_m * self.frame.ground
        return replace(self, frame=self.frame.only(~seen.is_below(ground_m, limit)))


class VisualInertialOdometry:
    """Estimates how a vehicle moves, frame by frame; pure.

    Args:
        camera: Of the frames that have no calibration of their own.
        mount: How the camera sits on the vehicle.
        parameters: Errors of what is given.
    """

    def __init__(
        self,
        camera: Camera,
        mount: Mount = NADIR,
        parameters: OdometryParameters | None = None,
    ) -> None:
        self._p = parameters or OdometryParameters()
        self._camera = camera
        self._mount = mount
        self._inertial = InertialHistory()
        self._track = PositionTrack(self._p.velocity_window_s)
        self._state: _VehicleState | None = None
        self._key: _Key | None = None
        self._last: NDArray[np.uint8] | None = None
        self._check = AccelerationCheck(self._p.acceleration_limit_m_s)
        self._strayed_m = 0.0
        """Way that the pictures and the accelerations differed by in the present doubt."""
        self._solved: deque[tuple[_VehicleState, Camera, Array]] = deque(maxlen=_KEPT)
        self._seen: ScoredView | None = None
        self.resets = 0
        """How often the position was given from outside, or continued by a guess."""

    def align(self, pose: Pose, velocity_m_s: tuple[float, float, float]) -> bool:
        """Begin from a known pose and velocity; the next frame becomes a key frame.

        Args:
            pose: Of the vehicle, with position and attitude.
            velocity_m_s: North, east, down.

        Returns:
            False, and nothing has changed, when one of them is not known.
        """
        known = pose.has_position and pose.has_height and pose.has_attitude
        if not (known and all(map(isfinite, velocity_m_s))):
            return False
        at = camera_pose(self._mount, pose)
        self._state = _VehicleState(
            pose.stamp_ns,
            pose.quaternion_ned_frd,
            np.array([at.north_m, at.east_m, at.down_m]),
            np.array(velocity_m_s),
            np.zeros((3, 3)),
            pose.stamp_ns,
        )
        self._key = None
        self._track.clear()
        self._check.begin(pose.stamp_ns, self._state.velocity_m_s)
        self._solved.clear()
        self._seen = None
        self._strayed_m = 0.0
        self.resets += 1
        return True

    def add_heatmap(self, heatmap: Heatmap) -> bool:
        """Leave out the corners that a heatmap calls clearly unsafe, until the next one.

        :return: False when it belongs to no frame of the last seconds whose place is known.
        """
        for state, camera, mount in self._solved:
            if state.stamp_ns == heatmap.stamp_ns:
                height, width = heatmap.safety.shape
                self._seen = ScoredView(
                    heatmap.safety,
                    camera.resized(width, height),
                    mount,
                    state.quaternion,
                    state.position_m,
                )
                if self._key is not None:
                    self._key = self._key.without(self._seen, self._p.movable_below)
                return True
        return False

    def add_inertial(self, sample: InertialSample) -> bool:
        """Keep body rates; False when they are not newer than the last ones, or impossible."""
        return self._inertial.add(sample)

    def add_frame(self, frame: Frame, altitude_agl_m: float) -> MotionEstimate | Doubt:
        """Return how the vehicle moved up to a frame, or why that is not known.

        After a gap of the body rates the attitude is not known: every frame is refused until the
        odometry is aligned again.

        Args:
            frame: Newer than the last one; body rates up to its stamp were given.
            altitude_agl_m: Of the vehicle at its stamp, as the autopilot reports it.
        """
        moved = self._moved_to(frame.stamp_ns)
        if isinstance(moved, Doubt):
            return moved
        state, rates_rad_s = moved
        picture = self._viewed(frame, state, altitude_agl_m, rates_rad_s)
        if isinstance(picture, Doubt):
            return picture
        if self._key is None:
            return self._begin_key(picture, state) or Doubt.BEGINNING
        if picture.camera != self._key.camera:
            return self._begin_again(picture, state) or Doubt.BEGINNING
        found = self._against(self._key, picture, state)
        if isinstance(found, Doubt):
            if state.lost_s > _LOST_S:
                self._begin_again(picture, state)
            return found
        return self._take(self._key, picture, state, *found)

    def _moved_to(self, stamp_ns: int) -> tuple[_VehicleState, Array] | Doubt:
        """Return what body rates and accelerations predict, and the rates at the stamp."""
        if self._state is None:
            return Doubt.UNALIGNED
        if stamp_ns <= self._state.stamp_ns:
            return Doubt.OLD
        motion = self._inertial.between(self._state.stamp_ns, stamp_ns)
        if motion is None:
            return Doubt.RATES
        self._check.accelerate(stamp_ns, self._state.change_m_s(stamp_ns, motion))
        self._state = self._state.after(stamp_ns, motion)
        return self._state, motion.rates_rad_s

    def _viewed(
        self, frame: Frame, state: _VehicleState, altitude_agl_m: float, rates_rad_s: Array
    ) -> _SeenPicture | Doubt:
        """Return the picture of a frame with what is known at its stamp."""
        height_m = altitude_agl_m - self._offset_m(state.quaternion)[2]
        if not (isfinite(height_m) and height_m >= _LOWEST_M):
            return Doubt.ALTITUDE
        grey = small_grey(frame.image_rgb, VIEW_PX)
        if self._last is not None and np.array_equal(grey, self._last):
            return Doubt.SAME
        self._last = grey
        camera = (frame.camera or self._camera).resized(grey.shape[1], grey.shape[0])
        mount = ground_to_camera(camera, camera_pose(Mount(self._mount.quaternion), _ONE_ABOVE))
        readout_s = self._p.row_time_s * frame.image_rgb.shape[0]
        readout = Readout(readout_s, mount @ rates_rad_s, state.velocity_m_s / height_m)
        return _SeenPicture(grey, camera, mount, height_m, readout)

    def _offset_m(self, quaternion: Quaternion) -> Array:
        """Return where the camera is: metres north, east, down of the vehicle."""
        return np.asarray(rotation_matrix(quaternion) @ np.array(self._mount.offset_frd_m))

    def _begin_key(
        self, picture: _SeenPicture, state: _VehicleState, fewest: int = _FEWEST
    ) -> Doubt | None:
        """Make a picture the key frame; if it has too few corners the old one stays."""
        frame = build_keyframe(
            picture.grey, picture.camera, state.quaternion, picture.mount, picture.readout
        )
        key = _Key(frame, picture.camera, state.position_m, picture.height_m, state.covariance_m2)
        still = key.without(self._seen, self._p.movable_below)
        if len(still.frame.ground) < max(_FEWEST, fewest):
            return Doubt.TEXTURE if len(frame.ground) < _FEWEST else Doubt.MOVABLE
        self._key = still
        self._solved.append((state, picture.camera, picture.mount))
        self._state = replace(state, solved_ns=state.stamp_ns)
        return None

    def _begin_again(self, picture: _SeenPicture, state: _VehicleState) -> Doubt | None:
        """Continue with a new key frame where the vehicle is believed to be."""
        grown = np.eye(3) * (0.5 * _LOST_M_S2 * state.lost_s**2) ** 2
        problem = self._begin_key(
            picture, replace(state, covariance_m2=state.covariance_m2 + grown)
        )
        if problem is None:
            self._track.clear()
            self.resets += 1
        return problem

    def _is_moving(self, velocity: Velocity, state: _VehicleState, span_s: float) -> bool:
        """Compare a velocity with the accelerations; after a doubt the position is a guess."""
        doubted = self._check.doubts
        if self._check.compare(velocity.stamp_ns, velocity.mean_m_s):
            self._strayed_m += self._check.off_m_s * span_s
        elif doubted and self._key is not None:
            strayed = np.eye(3) * self._strayed_m**2
            self._key = replace(self._key, covariance_m2=self._key.covariance_m2 + strayed)
            self._state = replace(state, covariance_m2=state.covariance_m2 + strayed)
            self._strayed_m = 0.0
            self.resets += 1
        return self._check.doubts

    def _against(
        self, key: _Key, picture: _SeenPicture, state: _VehicleState
    ) -> tuple[Solution, Matches] | Doubt:
        """Return where the camera is against a key frame."""
        if len(key.frame.ground) < _FEWEST:
            return Doubt.MOVABLE
        moved = (state.position_m - key.position_m) / key.height_m
        predicted = near = RelativePose(
            state.quaternion, moved[:2], max(_LEAST_RATIO, 1.0 - moved[2])
        )
        turn_deg = self._p.turn_error_deg + self._p.turn_drift_deg_s * state.lost_s
        errors = PriorErrors(radians(turn_deg), self._p.height_error)
        readout = replace(picture.readout, velocity=state.velocity_m_s / key.height_m)
        levels = _LEVELS_WHEN_NEAR if state.lost_s < _NEAR_S else _LEVELS
        for _ in range(2):
            matches = find(key.frame, picture.grey, picture.camera, near, picture.mount, levels)
            if len(matches.which) < max(_FEWEST, _LEAST_AGREEING * matches.expected):
                return Doubt.DIFFERENT
            directions, shifted = readout.at_once(picture.camera, matches.directions)
            solution = solve(
                key.frame.ground[matches.which] - shifted,
                (directions[:2] / directions[2]).T,
                predicted,
                errors,
                picture.mount,
                picture.camera.focal_px,
                picture.height_m / key.height_m,
            )
            off = np.linalg.norm(solution.place.position - near.position)
            near = solution.place
            if off * picture.camera.focal_px < _AGAIN_PX:
                break
        if np.linalg.norm(solution.turned_rad) > _LARGEST_TURN * errors.turn_rad:
            return Doubt.TURN
        return Doubt.ERROR if solution.error_px > _LARGEST_ERROR_PX else (solution, matches)

    def _take(
        self,
        key: _Key,
        picture: _SeenPicture,
        predicted: _VehicleState,
        solution: Solution,
        matches: Matches,
    ) -> MotionEstimate | Doubt:
        """Move to a place that was solved, and return the estimate."""
        place, agreeing = solution.place, len(matches.which)
        height_m = key.height_m * place.ratio
        position = key.position_m + key.height_m * place.position
        scale = np.diag([key.height_m, key.height_m, -height_m])
        error = scale @ solution.covariance[3:, 3:] @ scale
        shared = np.eye(3) * (_SHARED_ERROR * key.height_m) ** 2
        off = position - predicted.position_m
        state = self._state = _VehicleState(
            predicted.stamp_ns,
            place.quaternion_ned_frd,
            position,
            predicted.velocity_m_s + _VELOCITY_GAIN * off / predicted.lost_s,
            key.covariance_m2 + error + shared,
            predicted.stamp_ns,
        )
        self._solved.append((state, picture.camera, picture.mount))
        offset = self._offset_m(state.quaternion)
        # Corners share the error that hills give them: the more they scatter, the fewer count.
        rough = (solution.error_px / LEAST_ERROR_PX) ** 2
        self._track.add(state.stamp_ns, position - offset, rough * np.diag(error))
        if (
            agreeing < max(_FEW, _NEW_KEY_AGREEING * len(key.frame.ground))
            or solution.error_px > _NEW_KEY_ERROR_PX
            or not 1.0 / _NEW_KEY_RATIO < place.ratio < _NEW_KEY_RATIO
        ):
            self._begin_key(picture, state, agreeing)
        velocity = self._track.velocity()
        if velocity is None:
            return Doubt.BEGINNING
        if self._is_moving(velocity, state, predicted.lost_s):
            return Doubt.MOVING
        shift = max(_LEAST_SHIFT, float(np.hypot(*place.shift)))
        relief = solution.error_px / (picture.camera.focal_px * shift)
        scale_error = hypot(_ALTITUDE_ERROR, self._p.ground_error_m / height_m, relief)
        velocity_covariance = np.diag(velocity.variance_m2_s2) + scale_error**2 * np.outer(
            velocity.mean_m_s, velocity.mean_m_s
        )
        limit = self._p.velocity_error_limit_m_s
        if np.linalg.eigvalsh(velocity_covariance)[-1] > limit**2:
            return Doubt.UNCERTAIN
        north, east, down = (float(each) for each in position - offset)
        altitude_m = height_m + float(offset[2])
        return MotionEstimate(
            Pose(state.stamp_ns, north, east, down, state.quaternion, altitude_m),
            state.covariance_m2,
            velocity.mean_m_s,
            velocity.stamp_ns,
            velocity_covariance,
            agreeing / matches.expected,
            self.resets,
        )
