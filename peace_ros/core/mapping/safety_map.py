# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A ground grid in the local frame that gathers heatmaps, forgets, and follows the vehicle.

Each cell holds log-odds of being safe, in the way of occupancy grids (Moravec and Elfes, 1985),
with four differences that protect people on the ground: evidence for unsafe weighs more and is
kept longer, frames of one scene do not count as independent, a closer look outweighs any number of
farther ones, and what looks clearly unsafe closes the ground at once (see ``veto``).
"""

from __future__ import annotations

from functools import lru_cache
from math import ceil, cos, degrees, exp, floor, log
from typing import cast

import cv2
import numpy as np
from numpy.typing import NDArray

from peace_ros.core.domain import Camera, DepthImage, Heatmap, ImageError, Pose
from peace_ros.core.domain.errors import VehicleError
from peace_ros.core.domain.motion import FARTHEST_M
from peace_ros.core.mapping.flatness import rough_and_flat
from peace_ros.core.mapping.layers import MapLayers, shifted
from peace_ros.core.mapping.parameters import MapParameters
from peace_ros.core.mapping.projection import (
    GroundGrid,
    Window,
    project,
    tilt_rad,
    visible_window,
    worst_part,
)
from peace_ros.core.mapping.veto import Veto, blobs

LOWEST_LOOK_M = 1.0
"""Frames from lower are rejected: they show less ground than the vehicle covers."""
_NS = 1e-9
_NEVER_S = np.float32(-1e9)
_LOOKS_LIMIT = 60_000
_SEEN, _CLEARLY_UNSAFE = 1, 2
"""Kinds of pixels; 0 is ignored."""
_COARSER = 1.5
"""A look whose pixels are this much larger on the ground does not contradict a finer one."""
_MOST_HALVINGS = 60.0


class RefusedLookError(VehicleError):
    """A frame that cannot be projected; ``fate`` is the reason in a few words."""

    def __init__(self, fate: str, sentence: str) -> None:
        super().__init__(sentence)
        self.fate = fate


@lru_cache(maxsize=4)
def _believed(width: int, height: int, border_fraction: float) -> NDArray[np.uint8]:
    mask = np.zeros((height, width), np.uint8)
    bx, by = round(border_fraction * width), round(border_fraction * height)
    mask[by : height - by, bx : width - bx] = _SEEN
    mask.setflags(write=False)
    return mask


@lru_cache(maxsize=4)
def _evidence_table(neutral_score: float, look_limit: float) -> NDArray[np.float32]:
    """Evidence in log-odds of each heatmap value 0 to 255, zero at the neutral score."""
    value = (np.arange(256) + 0.5) / 256.0
    neutral = log(neutral_score / (1.0 - neutral_score))
    evidence = np.log(value / (1.0 - value)) - neutral
    return np.clip(evidence, -look_limit, look_limit).astype(np.float32)


class SafetyMap:
    """Rolling square map of how safe the ground is; not thread-safe."""

    def __init__(self, parameters: MapParameters | None = None) -> None:
        self.parameters = parameters or MapParameters()
        self._cells = max(1, round(self.parameters.map_size_m / self.parameters.map_cell_m))
        self._veto = Veto(self.parameters, self._cells)
        self.revision = -1
        """Grows with every change."""
        self.clear()

    def clear(self) -> None:
        """Forget everything."""
        self._veto.clear()
        shape = (self._cells, self._cells)
        self._rough = np.zeros(shape, np.bool_)
        """As it was measured last."""
        self._log_odds = np.zeros(shape, np.float32)
        self._seen_s = np.full(shape, _NEVER_S, np.float32)
        self._pixel_m = np.full(shape, np.inf, np.float32)
        self._looks = np.zeros(shape, np.uint16)
        self._first_row = self._first_column = 0
        self._epoch_ns: int | None = None
        self._stamp_ns = 0
        self.revision += 1

    @property
    def stamp_ns(self) -> int | None:
        """Stamp of the newest heatmap in the map, None when there is none."""
        return None if self._epoch_ns is None else self._stamp_ns

    def add(self, heatmap: Heatmap, camera: Camera, pose: Pose) -> int:
        """Lay a heatmap onto level ground and return how many cells it reached.

        :param camera: that of the full frame; the heatmap covers it, stretched or not.
        :param pose: where the camera was at the heatmap's stamp.
        :raises ImageError: on values that are not finite or not within 0 to 1, and on a stamp
            that is not newer than the last one.
        :raises RefusedLookError: (a VehicleError) on a pose that is not finite, not above ground or
            leans too far.
        """
        self._check(heatmap, pose)
        self._follow(pose)
        if self._epoch_ns is None:
            self._epoch_ns = heatmap.stamp_ns
            elapsed_s = float('inf')
        else:
            elapsed_s = (heatmap.stamp_ns - self._stamp_ns) * _NS
            safe_factor, unsafe_factor = self._decay(elapsed_s)
            positive = np.maximum(self._log_odds, 0.0)
            self._log_odds -= positive
            self._log_odds *= unsafe_factor
            positive *= safe_factor
            self._log_odds += positive
        self._stamp_ns = heatmap.stamp_ns
        self.revision += 1
        return self._lay(heatmap, camera, pose, elapsed_s)

    def add_depth(self, depth: DepthImage, camera: Camera, pose: Pose) -> None:
        """Close ground that is measured rough, until it is measured flat; opens nothing else.

        :param camera: that of the full frame; the depth image covers it.
        :param pose: where the camera was at the stamp of the depth image.
        :raises RefusedLookError: (a VehicleError) on a pose that is not finite, not above ground or
            leans too far.
        """
        self._check_pose(pose)
        self._follow(pose)
        rough, flat = rough_and_flat(depth, camera, pose, self._grid, self.parameters)
        self._rough |= rough
        self._rough &= ~flat

    def _check(self, heatmap: Heatmap, pose: Pose) -> None:
        low, high = float(heatmap.safety.min()), float(heatmap.safety.max())
        if not (low >= 0.0 and high <= 1.0):  # also refuses NaN
            raise ImageError(f'heatmap with values {low} to {high}: must be finite, within 0 to 1')
        if self._epoch_ns is not None and heatmap.stamp_ns <= self._stamp_ns:
            raise ImageError(
                f'heatmap stamp {heatmap.stamp_ns} ns: must be newer than the last one, '
                f'{self._stamp_ns} ns'
            )
        self._check_pose(pose)

    def _check_pose(self, pose: Pose) -> None:
        numbers = (pose.north_m, pose.east_m, pose.altitude_agl_m, *pose.quaternion_ned_frd)
        whole = pose.has_position and pose.has_height and pose.has_attitude
        if not whole or pose.altitude_agl_m < LOWEST_LOOK_M:
            raise RefusedLookError(
                'taken too low above ground' if whole else 'taken at an impossible place',
                f'pose {numbers}: must be numbers within {FARTHEST_M:g} m of the origin, with a '
                f'unit quaternion, {LOWEST_LOOK_M} m or more above ground to project a picture',
            )
        tilt_deg, limit_deg = degrees(tilt_rad(pose)), self.parameters.tilt_limit_deg
        if tilt_deg > limit_deg:
            raise RefusedLookError(
                'taken at too much tilt',
                f'camera at {tilt_deg:.0f} deg off the vertical: heatmaps are projected up to '
                f'{limit_deg:.0f} deg; wait until the vehicle flies level',
            )

    def _follow(self, pose: Pose) -> None:
        """Move the window by whole cells once the vehicle has left its middle."""
        cell = self.parameters.map_cell_m
        row = round(pose.north_m / cell) - self._cells // 2
        column = round(pose.east_m / cell) - self._cells // 2
        slack = self._cells // 12
        d_row, d_column = row - self._first_row, column - self._first_column
        if abs(d_row) <= slack and abs(d_column) <= slack:
            return
        self._first_row, self._first_column = row, column
        self._rough = shifted(self._rough, d_row, d_column, 0.0)
        if self._epoch_ns is None:
            return
        self._log_odds = shifted(self._log_odds, d_row, d_column, 0.0)
        self._seen_s = shifted(self._seen_s, d_row, d_column, float(_NEVER_S))
        self._pixel_m = shifted(self._pixel_m, d_row, d_column, float('inf'))
        self._looks = shifted(self._looks, d_row, d_column, 0)
        self._veto.shift(d_row, d_column)

    def widen_unsafe(self, distance_m: float) -> None:
        """Let everything unsafe and unknown grow, because the map has lost accuracy.

        :param distance_m: by how much; rounded up to whole cells.
        """
        reach = ceil(distance_m / self.parameters.map_cell_m)
        if reach < 1 or self._epoch_ns is None:
            return
        size = (2 * reach + 1, 2 * reach + 1)
        kernel = cast('NDArray[np.uint8]', cv2.getStructuringElement(cv2.MORPH_ELLIPSE, size))
        self._log_odds = cast('NDArray[np.float32]', cv2.erode(self._log_odds, kernel))
        self._seen_s = cast('NDArray[np.float32]', cv2.erode(self._seen_s, kernel))
        self._looks = cast('NDArray[np.uint16]', cv2.erode(self._looks, kernel))
        self._veto.widen(kernel)
        self._rough = cv2.dilate(self._rough.astype(np.uint8), kernel) > 0
        self.revision += 1

    def _decay(self, elapsed_s: float) -> tuple[float, float]:
        p, elapsed_s = self.parameters, max(0.0, elapsed_s)
        return (
            exp(-log(2.0) * elapsed_s / p.safe_half_life_s),
            exp(-log(2.0) * elapsed_s / p.unsafe_half_life_s),
        )

    @property
    def _grid(self) -> GroundGrid:
        cell = self.parameters.map_cell_m
        south, west = self._first_row * cell, self._first_column * cell
        return GroundGrid(south, west, cell, self._cells, self._cells)

    def _lay(self, heatmap: Heatmap, camera: Camera, pose: Pose, elapsed_s: float) -> int:
        p = self.parameters
        height, width = heatmap.safety.shape
        camera = camera.resized(width, height)
        window = visible_window(camera, pose, self._grid, p.off_nadir_limit_deg)
        if window is None:
            return 0
        grid = self._grid.part(window)
        fx, fy = camera.focal_xy_px
        pixel_wh_m = pose.altitude_agl_m / fx, pose.altitude_agl_m / fy
        per_cell = grid.cell_m / pixel_wh_m[0], grid.cell_m / pixel_wh_m[1]
        # Rounding down keeps the error on the side of unsafe.
        quantised = (heatmap.safety * 255.0).astype(np.uint8)
        kinds = _believed(width, height, p.border_fraction)
        unsafe = blobs(quantised, pixel_wh_m, grid.cell_m, p)
        if unsafe is not None:
            kinds = np.where((unsafe > 0) & (kinds > 0), np.uint8(_CLEARLY_UNSAFE), kinds)
        sampled, kind = project(worst_part(quantised, per_cell), kinds, camera, pose, grid)
        north = (np.arange(grid.rows) + 0.5) * grid.cell_m + (grid.south_m - pose.north_m)
        east = (np.arange(grid.columns) + 0.5) * grid.cell_m + (grid.west_m - pose.east_m)
        ground_sq = np.add.outer(north * north, east * east).astype(np.float32)
        # Squared secant of the slant: slant distance over altitude, and the off-nadir limit.
        secant_sq = 1.0 + ground_sq / np.float32(pose.altitude_agl_m**2)
        kind[secant_sq > 1.0 / cos(np.radians(p.off_nadir_limit_deg)) ** 2] = 0
        pixel_m = np.float32(pose.altitude_agl_m / camera.focal_px) * secant_sq
        apart_s = p.independent_after_s
        weight = 1.0 if elapsed_s >= apart_s else elapsed_s / apart_s
        self._gather(window, sampled, kind, pixel_m, weight)
        return int(np.count_nonzero(kind))

    def _gather(
        self,
        window: Window,
        sampled: NDArray[np.uint8],
        kind: NDArray[np.uint8],
        pixel_m: NDArray[np.float32],
        weight: float,
    ) -> None:
        p = self.parameters
        part, now_s, seen = window.slices, self._seconds(self._stamp_ns), kind > 0
        log_odds = self._log_odds[part]
        evidence = _evidence_table(p.neutral_score, p.look_limit)[sampled]
        finest_m = self._finest_pixel_m(part, now_s)
        finer = pixel_m / finest_m
        comparable = finer <= _COARSER
        self._veto.take(
            window,
            unsafe=kind == _CLEARLY_UNSAFE,
            clear=seen & comparable & (sampled >= p.clear_score * 255.0),
            was_safe=seen & (log_odds > 0.0),
            now_s=now_s,
        )
        # A finer look shrinks what was known from coarser ones; a coarser look adds less to safe
        # and takes nothing away from unsafe: it may not even have seen what lies there.
        old = log_odds * np.minimum(finer, 1.0)
        with np.errstate(divide='ignore'):
            trust = weight * np.minimum(1.0, 1.0 / finer)
        trust *= comparable | (log_odds >= 0.0)
        ceiling = np.minimum(p.safe_limit, p.repeat_limit * evidence)
        safer = np.maximum(old, np.minimum(old + trust * evidence, ceiling))
        worse = np.maximum(old + (weight * p.unsafe_weight) * evidence, -p.unsafe_limit)
        new = np.where(evidence >= 0.0, safer, worse)
        np.copyto(log_odds, new, where=seen)
        np.copyto(self._pixel_m[part], np.minimum(pixel_m, finest_m), where=seen)
        np.copyto(self._seen_s[part], now_s, where=seen)
        looks = self._looks[part]
        np.add(looks, 1, out=looks, where=seen & (looks < _LOOKS_LIMIT))

    def _finest_pixel_m(self, part: tuple[slice, slice], now_s: float) -> NDArray[np.float32]:
        """Return the finest pixels of late; they count as larger the longer ago they looked."""
        halvings = (now_s - self._seen_s[part]) / np.float32(self.parameters.fine_memory_s)
        finest: NDArray[np.float32] = self._pixel_m[part] * np.exp2(
            np.minimum(halvings, np.float32(_MOST_HALVINGS))
        )
        return finest

    def _seconds(self, stamp_ns: int) -> float:
        return (stamp_ns - (self._epoch_ns or 0)) * _NS

    def layers(self, now_ns: int, around: tuple[float, float, float] | None = None) -> MapLayers:
        """Return what is known now; fresh arrays.

        Evidence is decayed up to now, so an old map loses its safe ground by itself.

        :param around: north, east and half edge in metres of the square that matters; by default
            the whole window. Cells outside of the window are left out (maybe all of them).
        """
        grid = self._grid
        rows, columns = slice(0, self._cells), slice(0, self._cells)
        if around is not None:
            north_m, east_m, half_m = around
            rows = self._span(north_m - half_m - grid.south_m, north_m + half_m - grid.south_m)
            columns = self._span(east_m - half_m - grid.west_m, east_m + half_m - grid.west_m)
        log_odds, looks = self._log_odds[rows, columns], self._looks[rows, columns]
        safe_factor, unsafe_factor = self._decay((now_ns - self._stamp_ns) * _NS)
        aged = log_odds * np.where(
            log_odds > 0.0, np.float32(safe_factor), np.float32(unsafe_factor)
        )
        known = looks > 0
        score = np.where(known, 1.0 / (1.0 + np.exp(-aged)), 0.0).astype(np.float32)
        unsafe_age = self._veto.age_s(rows, columns, self._seconds(now_ns))
        score[np.isfinite(unsafe_age)] = 0.0
        score[self._rough[rows, columns]] = 0.0
        age = self._seconds(now_ns) - self._seen_s[rows, columns]
        age = np.where(known, age, np.inf).astype(np.float32)
        south_m = grid.south_m + rows.start * grid.cell_m
        west_m = grid.west_m + columns.start * grid.cell_m
        return MapLayers(score, age, looks.copy(), grid.cell_m, south_m, west_m, unsafe_age)

    def _span(self, low_m: float, high_m: float) -> slice:
        cell = self.parameters.map_cell_m
        first = min(self._cells, max(0, floor(low_m / cell)))
        return slice(first, min(self._cells, max(first, ceil(high_m / cell))))

    def score_around(
        self, north_m: float, east_m: float, radius_m: float, now_ns: int
    ) -> tuple[float, float]:
        """Return the worst score (0 when any cell is unknown) and the oldest age of a disc.

        Outside of the window nothing is known: (0, infinity).
        """
        cell = self.parameters.map_cell_m
        layers = self.layers(now_ns, (north_m, east_m, radius_m + cell))
        for sign in (-1.0, 1.0):
            if layers.cell_at(north_m + sign * radius_m, east_m + sign * radius_m) is None:
                return 0.0, float('inf')
        inside = layers.disc(north_m, east_m, max(radius_m, cell))
        return float(layers.score[inside].min()), float(layers.age_s[inside].max())
