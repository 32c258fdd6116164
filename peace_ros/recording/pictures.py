# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The two pictures of a run: its trajectory over the world, and a filmstrip of its states.

World coordinates are metres east and north of the centre of the world image, whose top is north.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from math import ceil

import cv2
import numpy as np
from numpy.typing import NDArray

from peace_ros.core.domain import RecordingError
from peace_ros.recording import canvas
from peace_ros.recording.canvas import Image, Point

_MAP_PX = 1000
_PANEL_PX = 400
_MARGIN_M = 45.0
_SMALLEST_VIEW_M = 120.0


@dataclass(frozen=True)
class TrackPoint:
    """Where the vehicle was at one moment."""

    time_s: float
    east_m: float
    north_m: float
    altitude_agl_m: float


@dataclass(frozen=True)
class SiteMark:
    """A place that the landing node chose."""

    east_m: float
    north_m: float
    clearance_m: float


@dataclass(frozen=True)
class TrajectoryScene:
    """What the trajectory picture shows."""

    world_rgb: NDArray[np.uint8]
    gsd_m: float
    """Metres per pixel of the world image."""
    track: tuple[TrackPoint, ...]
    engaged_at_s: float | None = None
    """Time on the track when the landing node was given control."""
    sites: tuple[SiteMark, ...] = ()
    """In the order in which they were chosen; the last is the final one."""
    hand_over: tuple[float, float] | None = None
    """East and north of the hand-over point."""
    hand_over_clearance_m: float | None = None
    """Distance from it to the nearest ground that the ground truth calls unsafe."""
    safe: bool | None = None
    title: str = ''
    lines: tuple[str, ...] = field(default=())
    """What the panel says under the title."""


class _MapView:
    """A square of the world, drawn north up at ``_MAP_PX``; ground beyond the world mirrored."""

    def __init__(self, scene: TrajectoryScene) -> None:
        easts = [point.east_m for point in scene.track] + [site.east_m for site in scene.sites]
        norths = [point.north_m for point in scene.track] + [site.north_m for site in scene.sites]
        self.centre = (
            (min(easts) + max(easts)) / 2.0,
            (min(norths) + max(norths)) / 2.0,
        )
        span = max(max(easts) - min(easts), max(norths) - min(norths)) + 2.0 * _MARGIN_M
        self.span_m = max(span, _SMALLEST_VIEW_M)
        self.m_per_px = self.span_m / _MAP_PX

    def pixel(self, east_m: float, north_m: float) -> Point:
        return (
            round(_MAP_PX / 2 + (east_m - self.centre[0]) / self.m_per_px),
            round(_MAP_PX / 2 - (north_m - self.centre[1]) / self.m_per_px),
        )

    def picture(self, world_rgb: NDArray[np.uint8], gsd_m: float) -> Image:
        height, width = world_rgb.shape[:2]
        per_px = self.m_per_px / gsd_m
        # Pixel (u, v) of the map shows the world pixel at this affine position.
        matrix = np.array(
            [
                [per_px, 0.0, (self.centre[0] / gsd_m + width / 2) - per_px * _MAP_PX / 2],
                [0.0, per_px, (height / 2 - self.centre[1] / gsd_m) - per_px * _MAP_PX / 2],
            ]
        )
        if per_px > 2.0:
            # Warping alone would pick single pixels of a fine world; shrink it first.
            factor = 1.0 / per_px
            small = cv2.resize(world_rgb, None, fx=factor, fy=factor, interpolation=cv2.INTER_AREA)
            matrix = matrix / per_px
        else:
            small = world_rgb
        flags = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
        warped = cv2.warpAffine(
            small, matrix, (_MAP_PX, _MAP_PX), flags=flags, borderMode=cv2.BORDER_REFLECT
        )
        return np.asarray(warped, np.uint8)


def draw_trajectory(scene: TrajectoryScene) -> Image:
    """Draw the path over the world, coloured by altitude, with a legend.

    Returns:
        1000 x 1400 x 3 uint8 RGB.

    Raises:
        RecordingError: the track is empty.

    """
    if not scene.track:
        raise RecordingError('a trajectory of 0 points cannot be drawn: no pose was recorded')
    view = _MapView(scene)
    ground = view.picture(scene.world_rgb, scene.gsd_m)
    _draw_world_edge(ground, view, scene)
    _draw_path(ground, view, scene)
    _draw_places(ground, view, scene)
    canvas.scale_bar(ground, (30, _MAP_PX - 40), view.m_per_px, _MAP_PX // 4)
    canvas.north_arrow(ground, (_MAP_PX - 50, 100))
    panel = canvas.blank(_PANEL_PX, _MAP_PX)
    _draw_panel(panel, view, scene)
    return np.hstack([ground, panel])


def _draw_world_edge(ground: Image, view: _MapView, scene: TrajectoryScene) -> None:
    height, width = scene.world_rgb.shape[:2]
    half_e, half_n = width * scene.gsd_m / 2, height * scene.gsd_m / 2
    corners = (view.pixel(-half_e, half_n), view.pixel(half_e, -half_n))
    cv2.rectangle(ground, *corners, (0, 0, 0), 5)
    cv2.rectangle(ground, *corners, (255, 255, 255), 2)


def _altitude_range(scene: TrajectoryScene) -> tuple[float, float]:
    highest = max(point.altitude_agl_m for point in scene.track)
    return 0.0, max(20.0, 10.0 * ceil(highest / 10.0))


def _draw_path(ground: Image, view: _MapView, scene: TrajectoryScene) -> None:
    pixels = [view.pixel(point.east_m, point.north_m) for point in scene.track]
    altitudes = np.array([point.altitude_agl_m for point in scene.track])
    colours = canvas.altitude_colours(altitudes, *_altitude_range(scene))
    outline = np.array(pixels, np.int32).reshape(-1, 1, 2)
    cv2.polylines(ground, [outline], False, (0, 0, 0), 9, cv2.LINE_AA)
    for begin, end, colour in zip(pixels[:-1], pixels[1:], colours[1:], strict=True):
        shade = tuple(int(each) for each in colour)
        cv2.line(ground, begin, end, shade, 5, cv2.LINE_AA)


def _draw_places(ground: Image, view: _MapView, scene: TrajectoryScene) -> None:
    for number, site in enumerate(scene.sites):
        last = number == len(scene.sites) - 1
        at = view.pixel(site.east_m, site.north_m)
        colour = (80, 230, 255) if last else (150, 190, 200)
        radius = max(4, round(site.clearance_m / view.m_per_px))
        canvas.outlined_circle(ground, at, radius, colour)
        canvas.outlined_circle(ground, at, 3, colour)
    start = view.pixel(scene.track[0].east_m, scene.track[0].north_m)
    cv2.rectangle(ground, _shift(start, -8), _shift(start, 8), (0, 0, 0), -1)
    cv2.rectangle(ground, _shift(start, -6), _shift(start, 6), (255, 255, 255), -1)
    engaged = _engaged_point(scene)
    if engaged is not None:
        canvas.outlined_circle(
            ground, view.pixel(engaged.east_m, engaged.north_m), 9, (255, 120, 255)
        )
    if scene.hand_over is not None:
        at = view.pixel(*scene.hand_over)
        colour = _verdict_colour(scene.safe)
        if scene.hand_over_clearance_m:
            radius = max(4, round(scene.hand_over_clearance_m / view.m_per_px))
            canvas.outlined_circle(ground, at, radius, colour)
        canvas.cross(ground, at, 22, colour)


def _engaged_point(scene: TrajectoryScene) -> TrackPoint | None:
    if scene.engaged_at_s is None:
        return None
    moment = scene.engaged_at_s
    return min(scene.track, key=lambda point: abs(point.time_s - moment))


def _shift(at: Point, by: int) -> Point:
    return at[0] + by, at[1] + by


def _verdict_colour(safe: bool | None) -> canvas.Colour:
    if safe is None:
        return canvas.WARN
    return canvas.GOOD if safe else canvas.BAD


def _draw_panel(panel: Image, view: _MapView, scene: TrajectoryScene) -> None:
    y = 44
    for line in canvas.wrap(scene.title, _PANEL_PX - 48, 0.75):
        canvas.put_text(panel, line, (24, y), scale=0.75, thickness=2)
        y += 30
    y += 6
    for text in scene.lines:
        for line in canvas.wrap(text, _PANEL_PX - 48, 0.52):
            canvas.put_text(panel, line, (24, y), scale=0.52)
            y += 23
    y = _draw_legend(panel, max(y + 14, 300), scene)
    _draw_profile(panel, (60, y + 34), (_PANEL_PX - 84, 130), scene)
    _draw_inset(panel, view, scene, top=y + 34 + 130 + 60)


def _draw_legend(panel: Image, top: int, scene: TrajectoryScene) -> int:
    """Draw the symbols that occur in the map; return the y below them."""
    y = top
    cv2.rectangle(panel, (30, y - 12), (42, y), (255, 255, 255), -1)
    on_ground = scene.track[0].altitude_agl_m < 5.0
    text = 'start on the ground' if on_ground else 'first pose'
    canvas.put_text(panel, text, (64, y), scale=0.52)
    if scene.engaged_at_s is not None:
        y += 30
        canvas.outlined_circle(panel, (36, y - 6), 9, (255, 120, 255))
        canvas.put_text(panel, 'landing node engaged', (64, y), scale=0.52)
    if scene.sites:
        y += 30
        canvas.outlined_circle(panel, (36, y - 6), 10, (80, 230, 255))
        canvas.outlined_circle(panel, (36, y - 6), 3, (80, 230, 255))
        canvas.put_text(panel, 'chosen site, estimated clearance', (64, y), scale=0.52)
    if scene.hand_over is not None:
        y += 30
        canvas.cross(panel, (36, y - 6), 16, _verdict_colour(scene.safe))
        verdict = {True: 'safe', False: 'UNSAFE', None: 'no ground truth'}[scene.safe]
        canvas.put_text(panel, f'hand-over point ({verdict})', (64, y), scale=0.52)
        if scene.hand_over_clearance_m is not None:
            y += 24
            text = f'true clearance {scene.hand_over_clearance_m:.1f} m (circle)'
            canvas.put_text(panel, text, (64, y), scale=0.52)
    y += 34
    low, high = _altitude_range(scene)
    width = _PANEL_PX - 84
    ramp = canvas.altitude_colours(np.linspace(low, high, width), low, high)
    panel[y - 12 : y, 30 : 30 + width] = ramp
    canvas.put_text(panel, f'{low:.0f}', (26, y + 18), scale=0.45)
    canvas.put_text(panel, 'altitude (m)', (150, y + 18), scale=0.45)
    canvas.put_text(panel, f'{high:.0f}', (30 + width - 26, y + 18), scale=0.45)
    return y + 18


def _draw_profile(panel: Image, at: Point, size: Point, scene: TrajectoryScene) -> None:
    """Plot altitude over time."""
    x, y = at
    width, height = size
    low, high = _altitude_range(scene)
    first, last = scene.track[0].time_s, scene.track[-1].time_s
    span = max(last - first, 1e-6)
    cv2.line(panel, (x, y), (x, y + height), canvas.FAINT, 1)
    cv2.line(panel, (x, y + height), (x + width, y + height), canvas.FAINT, 1)
    times = np.array([point.time_s for point in scene.track])
    altitudes = np.array([point.altitude_agl_m for point in scene.track])
    us = (x + (times - first) / span * width).round().astype(int)
    vs = (y + height - (altitudes - low) / (high - low) * height).round().astype(int)
    colours = canvas.altitude_colours(altitudes, low, high)
    for k in range(len(us) - 1):
        shade = tuple(int(each) for each in colours[k])
        cv2.line(panel, (us[k], vs[k]), (us[k + 1], vs[k + 1]), shade, 2, cv2.LINE_AA)
    if scene.engaged_at_s is not None:
        mark = x + round((scene.engaged_at_s - first) / span * width)
        cv2.line(panel, (mark, y), (mark, y + height), (255, 120, 255), 1, cv2.LINE_AA)
    canvas.put_text(panel, f'{high:.0f} m', (14, y + 10), scale=0.42)
    canvas.put_text(panel, '0', (40, y + height), scale=0.42)
    canvas.put_text(panel, '0 s', (x, y + height + 18), scale=0.42)
    end = f'{span:.0f} s'
    left = x + width - canvas.text_width(end, 0.42)
    canvas.put_text(panel, end, (left, y + height + 18), scale=0.42)


def _draw_inset(panel: Image, view: _MapView, scene: TrajectoryScene, top: int) -> None:
    """Show the whole world, small, with the frame of the map on it."""
    height, width = scene.world_rgb.shape[:2]
    room = min(_MAP_PX - top - 20, _PANEL_PX - 60)
    if room < 60:
        return
    small = canvas.fitted(scene.world_rgb, room)
    size = (small.shape[1], small.shape[0])
    per_px = scene.gsd_m * max(height, width) / room

    def at(east_m: float, north_m: float) -> Point:
        return round(size[0] / 2 + east_m / per_px), round(size[1] / 2 - north_m / per_px)

    half = view.span_m / 2
    east, north = view.centre
    corners = at(east - half, north + half), at(east + half, north - half)
    cv2.rectangle(small, *corners, (0, 0, 0), 3)
    cv2.rectangle(small, *corners, (255, 255, 255), 1)
    panel[top : top + size[1], 30 : 30 + size[0]] = small
    text = f'whole world, {width * scene.gsd_m:.0f} x {height * scene.gsd_m:.0f} m'
    canvas.put_text(panel, text, (30, top - 8), scale=0.45, colour=canvas.FAINT)
