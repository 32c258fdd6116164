# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The picture of a run: its trajectory over the world, with a legend and altitude over time.

World coordinates are metres east and north of the centre of the world image, whose top is north.
"""

from __future__ import annotations

import textwrap
from dataclasses import dataclass, field
from itertools import pairwise
from math import ceil, floor, log10
from typing import Any, TypeVar

import cv2
import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Circle, Rectangle
from matplotlib.patheffects import withStroke
from numpy.typing import NDArray

from peace_ros.core.domain import RecordingError
from peace_ros.recording import canvas
from peace_ros.recording.canvas import Image

ArtistT = TypeVar('ArtistT', bound=Artist)

_MAP_PX = 1000
_PANEL_PX = 400
_MARGIN_M = 45.0
_SMALLEST_VIEW_M = 120.0
_SITE, _EARLIER_SITE, _ENGAGED = '#50e6ff', '#96bec8', '#ff78ff'
_VERDICTS = {
    True: ('safe', '#5adc6e'),
    False: ('UNSAFE', '#ff5046'),
    None: ('no ground truth', '#ffbe3c'),
}


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

    @property
    def size_m(self) -> tuple[float, float]:
        """(east-west, north-south) extent of the world."""
        height, width = self.world_rgb.shape[:2]
        return width * self.gsd_m, height * self.gsd_m

    @property
    def top_m(self) -> float:
        """Altitude at the upper end of the scale."""
        highest = max(point.altitude_agl_m for point in self.track)
        return max(20.0, 10.0 * ceil(highest / 10.0))


class _MapView:
    """A square of the world, drawn north up; ground beyond the world is mirrored."""

    def __init__(self, scene: TrajectoryScene) -> None:
        places = [(point.east_m, point.north_m) for point in scene.track]
        places += [(site.east_m, site.north_m) for site in scene.sites]
        low, high = np.min(places, axis=0), np.max(places, axis=0)
        self.span_m = max(float((high - low).max()) + 2.0 * _MARGIN_M, _SMALLEST_VIEW_M)
        self.low_m = (low + high - self.span_m) / 2.0
        east, north = self.low_m.tolist()
        self.extent_m = (east, east + self.span_m, north, north + self.span_m)

    def picture(self, world_rgb: NDArray[np.uint8], gsd_m: float) -> Image:
        height, width = world_rgb.shape[:2]
        per_px = self.span_m / _MAP_PX / gsd_m
        west, _, _, north = (each / gsd_m for each in self.extent_m)
        # Pixel (u, v) of the map shows the world pixel at this affine position.
        matrix = np.array([[per_px, 0.0, west + width / 2], [0.0, per_px, height / 2 - north]])
        if per_px > 2.0:
            # Warping alone would pick single pixels of a fine world; shrink it first.
            factor, matrix = 1.0 / per_px, matrix / per_px
            world_rgb = np.asarray(
                cv2.resize(world_rgb, None, fx=factor, fy=factor, interpolation=cv2.INTER_AREA)
            )
        flags = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
        size = (_MAP_PX, _MAP_PX)
        warped = cv2.warpAffine(world_rgb, matrix, size, flags=flags, borderMode=cv2.BORDER_REFLECT)
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
    sheet = canvas.sheet(_MAP_PX + _PANEL_PX, _MAP_PX)
    ground = canvas.window(sheet, 0, 0, _MAP_PX, _MAP_PX)
    image = view.picture(scene.world_rgb, scene.gsd_m)
    ground.imshow(image, extent=view.extent_m, interpolation='nearest')
    east, north = scene.size_m
    edge = Rectangle((-east / 2, -north / 2), east, north, fill=False, edgecolor='white')
    ground.add_patch(_outlined(edge))
    places = [(point.east_m, point.north_m) for point in scene.track]
    # One outline for the whole path: those of its steps would cover the colours beside them.
    ground.plot(*zip(*places, strict=True), color='black', linewidth=6.5, solid_capstyle='round')
    ground.add_collection(_coloured(places, scene, 4.0))
    marks = _draw_places(ground, scene)
    _draw_scale(ground, view)
    ground.axis(view.extent_m)
    _draw_panel(sheet, scene, marks)
    _draw_profile(canvas.window(sheet, _MAP_PX + 60, 500, _PANEL_PX - 84, 150), scene)
    _draw_inset(canvas.window(sheet, _MAP_PX + 30, 730, _PANEL_PX - 60, 250), view, scene)
    return canvas.pixels(sheet)


def _outlined(artist: ArtistT) -> ArtistT:
    """Let an artist show on light and dark ground."""
    width = artist.get_linewidth() if hasattr(artist, 'get_linewidth') else 1.5
    artist.set_path_effects([withStroke(linewidth=float(np.max(width)) + 2.5, foreground='black')])
    return artist


def _coloured(
    places: list[tuple[float, float]], scene: TrajectoryScene, width: float
) -> LineCollection:
    """Return the line through the places of the track: blue low, red high."""
    steps = list(pairwise(places))
    line = LineCollection(steps, cmap='turbo', clim=(0.0, scene.top_m), linewidth=width)
    line.set_capstyle('round')
    line.set_array([point.altitude_agl_m for point in scene.track[1:]])
    return line


def _draw_places(ground: Axes, scene: TrajectoryScene) -> list[Line2D]:
    """Draw what happened where; return the symbols of the legend."""

    def mark(east_m: float, north_m: float, symbol: str, colour: str, name: str) -> None:
        style: dict[str, Any] = {'color': colour, 'markersize': 8.0, 'markeredgewidth': 2.5}
        if symbol == 'o':
            style['markerfacecolor'] = 'none'
        (line,) = ground.plot(east_m, north_m, symbol, linestyle='', label=name, **style)
        marks[name] = _outlined(line)

    def ring(east_m: float, north_m: float, radius_m: float, colour: str) -> None:
        shape = Circle((east_m, north_m), radius_m, fill=False, edgecolor=colour, linewidth=1.5)
        ground.add_patch(_outlined(shape))

    marks: dict[str, Line2D] = {}
    for number, site in enumerate(scene.sites, start=1):
        colour = _SITE if number == len(scene.sites) else _EARLIER_SITE
        ring(site.east_m, site.north_m, site.clearance_m, colour)
        mark(site.east_m, site.north_m, '.', colour, 'chosen site, estimated clearance')
    first = scene.track[0]
    name = 'start on the ground' if first.altitude_agl_m < 5.0 else 'first pose'
    mark(first.east_m, first.north_m, 's', 'white', name)
    if (at_s := scene.engaged_at_s) is not None:
        point = min(scene.track, key=lambda each: abs(each.time_s - at_s))
        mark(point.east_m, point.north_m, 'o', _ENGAGED, 'landing node engaged')
    if scene.hand_over is not None:
        verdict, colour = _VERDICTS[scene.safe]
        name = f'hand-over point ({verdict})'
        if (clear_m := scene.hand_over_clearance_m) is not None:
            name += f'\ntrue clearance {clear_m:.1f} m (circle)'
            ring(*scene.hand_over, clear_m, colour)
        mark(*scene.hand_over, 'x', colour, name)
    return list(marks.values())


def nice_length_m(at_most_m: float) -> float:
    """Return the largest of 1, 2, 5 x 10^n metres that fits."""
    power = 10.0 ** floor(log10(max(at_most_m, 1e-3)))
    return max(step * power for step in (1.0, 2.0, 5.0) if step * power <= at_most_m * 1.0001)


def _draw_scale(ground: Axes, view: _MapView) -> None:
    """Draw a bar with its length, and an arrow to the north."""
    length_m = nice_length_m(view.span_m / 4.0)
    east, north = view.low_m + 0.03 * view.span_m
    _outlined(ground.plot((east, east + length_m), (north, north), color='white', linewidth=5)[0])
    _outlined(ground.text(east, north + 0.015 * view.span_m, f'{length_m:g} m', color='white'))
    arrow = {'arrowstyle': 'simple', 'facecolor': 'white', 'edgecolor': 'black'}
    ground.annotate('', (0.95, 0.95), (0.95, 0.9), 'axes fraction', arrowprops=arrow)
    _outlined(ground.text(0.95, 0.96, 'N', color='white', ha='center', transform=ground.transAxes))


def _draw_panel(sheet: Figure, scene: TrajectoryScene, marks: list[Line2D]) -> None:
    title = textwrap.wrap(scene.title, 36)
    canvas.write(sheet, _MAP_PX + 24, 44, '\n'.join(title), 12, weight='bold')
    lines = [part for line in scene.lines for part in textwrap.wrap(line, 46)]
    canvas.write(sheet, _MAP_PX + 24, 60 + 24 * len(title), '\n'.join(lines), 9.5)
    corner = ((_MAP_PX + 12) / (_MAP_PX + _PANEL_PX), 0.7)
    sheet.legend(
        handles=marks, loc='upper left', bbox_to_anchor=corner, frameon=False,
        labelcolor=canvas.INK, fontsize=9.5, labelspacing=0.8,
    )  # fmt: skip


def _draw_profile(axes: Axes, scene: TrajectoryScene) -> None:
    """Plot altitude over time, in the colours of the path."""
    axes.set_axis_on()
    axes.set(facecolor=canvas.PAPER, xlabel='s', ylabel='altitude (m)')
    first = scene.track[0].time_s
    places = [(point.time_s - first, point.altitude_agl_m) for point in scene.track]
    axes.add_collection(_coloured(places, scene, 2.0))
    axes.axis((0.0, max(places[-1][0], 1e-6), 0.0, scene.top_m))
    if scene.engaged_at_s is not None:
        axes.axvline(scene.engaged_at_s - first, color=_ENGAGED, linewidth=1.0)
    axes.tick_params(colors=canvas.INK, labelsize=8)
    axes.xaxis.label.set_color(canvas.INK)
    axes.yaxis.label.set_color(canvas.INK)
    for side, spine in axes.spines.items():
        spine.set(color=canvas.FAINT, visible=side in {'left', 'bottom'})


def _draw_inset(axes: Axes, view: _MapView, scene: TrajectoryScene) -> None:
    """Show the whole world, small, with the frame of the map on it."""
    east, north = scene.size_m
    extent_m = (-east / 2, east / 2, -north / 2, north / 2)
    step = max(1, max(scene.world_rgb.shape) // _MAP_PX)
    axes.imshow(scene.world_rgb[::step, ::step], extent=extent_m)
    frame = Rectangle(tuple(view.low_m), view.span_m, view.span_m, fill=False, edgecolor='white')
    axes.add_patch(_outlined(frame))
    axes.axis(extent_m)
    text = f'whole world, {east:.0f} x {north:.0f} m'
    axes.set_title(text, color=canvas.FAINT, fontsize=8.5, loc='left')
