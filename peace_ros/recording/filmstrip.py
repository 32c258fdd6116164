# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A strip of moments: what the camera saw, what the networks said, where the focus lay."""

from __future__ import annotations

import textwrap
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import LinearSegmentedColormap
from matplotlib.figure import Figure
from matplotlib.patches import Circle
from numpy.typing import NDArray

from peace_ros.core.domain import RecordingError
from peace_ros.recording import canvas
from peace_ros.recording.canvas import Image

_CELL_PX = 280
_GAP_PX = 12
_LABEL_PX = 128
_SIDE_PX = 96
_TITLE_PX = 50
_COLUMNS = 6
_LETTERS = 42
"""In a line of the prompt."""
_SAFETY = LinearSegmentedColormap.from_list('safety', ['#d70028', '#d7b928', '#00b928'])
"""Unsafe, doubtful, safe."""
_SITE = '#50e6ff'


@dataclass(frozen=True)
class FilmMoment:
    """One column of the strip."""

    state: str
    time_s: float
    """Since the landing node was engaged."""
    altitude_agl_m: float | None
    prompt: str
    frame_rgb: NDArray[np.uint8] | None
    """Height x width x 3; None when no frame had come yet."""
    heatmap: NDArray[np.uint8] | None
    """Height x width, 0 unsafe to 255 safe; covers the frame."""
    focus_centre: tuple[float, float] | None = None
    """(u, v) as fractions of the frame's width and height."""
    focus_radius: float | None = None
    """As a fraction of the frame's width; None when the whole image counts."""
    site: tuple[float, float] | None = None
    """(u, v) of the chosen site as fractions of the frame; may lie outside 0 to 1."""


def draw_filmstrip(moments: list[FilmMoment], title: str = '') -> Image:
    """Draw frame, heatmap and focus of each moment, at most six moments to a row.

    Raises:
        RecordingError: there is no moment at all.
    """
    if not moments:
        raise RecordingError('a filmstrip of 0 moments cannot be drawn: no state was recorded')
    rows = -(-len(moments) // _COLUMNS)
    columns = -(-len(moments) // rows)
    step = _CELL_PX + _GAP_PX
    high = _LABEL_PX + 3 * step + _GAP_PX
    sheet = canvas.sheet(_SIDE_PX + columns * step + _GAP_PX, _TITLE_PX + rows * high)
    canvas.write(sheet, _GAP_PX, 33, title, 11, weight='bold')
    for row in range(rows):
        _draw_names(sheet, _TITLE_PX + row * high)
    for number, moment in enumerate(moments):
        row, column = divmod(number, columns)
        left, top = _SIDE_PX + column * step, _TITLE_PX + row * high
        _draw_labels(sheet, left, top, moment)
        for k, draw in enumerate((_draw_camera, _draw_heatmap, _draw_focus)):
            draw(canvas.window(sheet, left, top + _LABEL_PX + k * step, _CELL_PX, _CELL_PX), moment)
    return canvas.pixels(sheet)


def _draw_names(sheet: Figure, top: int) -> None:
    for k, name in enumerate(('camera', 'heatmap', 'focus')):
        middle = top + _LABEL_PX + k * (_CELL_PX + _GAP_PX) + _CELL_PX // 2
        canvas.write(sheet, _GAP_PX, middle, name, 9, color=canvas.FAINT)
    middle = top + _LABEL_PX + _CELL_PX + _GAP_PX + _CELL_PX // 2
    for k, (name, level) in enumerate((('safe', 1.0), ('doubtful', 0.5), ('unsafe', 0.0))):
        canvas.write(sheet, _GAP_PX, middle + 26 + 20 * k, '\u25a0', 8, color=_SAFETY(level))
        canvas.write(sheet, _GAP_PX + 16, middle + 26 + 20 * k, name, 8, color=canvas.FAINT)


def _draw_labels(sheet: Figure, left: int, top: int, moment: FilmMoment) -> None:
    canvas.write(sheet, left, top + 24, moment.state, 11, weight='bold')
    altitude = 'no altitude' if moment.altitude_agl_m is None else f'{moment.altitude_agl_m:.1f} m'
    canvas.write(sheet, left, top + 48, f'{altitude}   at {moment.time_s:.1f} s', 9)
    lines = textwrap.wrap(moment.prompt or 'no prompt yet', _LETTERS)
    canvas.write(sheet, left, top + 70, '\n'.join(lines[:4]), 8, color=canvas.FAINT)


def _draw_missing(cell: Axes, what: str) -> None:
    cell.imshow(np.full((1, 1, 3), 50, np.uint8), extent=(0.0, 1.0, 0.0, 1.0))
    cell.text(0.5, 0.5, what, color=canvas.INK, size=9, ha='center')


def _draw_camera(cell: Axes, moment: FilmMoment) -> None:
    if moment.frame_rgb is None:
        _draw_missing(cell, 'no frame yet')
    else:
        cell.imshow(moment.frame_rgb)


def _draw_heatmap(cell: Axes, moment: FilmMoment) -> None:
    if moment.heatmap is None:
        _draw_missing(cell, 'no heatmap yet')
        return
    height, width = (moment.heatmap if moment.frame_rgb is None else moment.frame_rgb).shape[:2]
    cell.imshow(moment.heatmap, _SAFETY, vmin=0, vmax=255, extent=(0, width, height, 0))


def _draw_focus(cell: Axes, moment: FilmMoment) -> None:
    """Darken what the landing node does not look at, and mark the site."""
    if moment.frame_rgb is None:
        _draw_missing(cell, 'no frame yet')
        return
    height, width = moment.frame_rgb.shape[:2]
    picture = cell.imshow(moment.frame_rgb)
    if moment.focus_radius is not None:
        u, v = moment.focus_centre or (0.5, 0.5)
        focus = Circle((u * width, v * height), moment.focus_radius * width, fill=False, ec='white')
        cell.imshow(moment.frame_rgb // 4, zorder=picture.zorder - 1.0)
        cell.add_patch(focus)
        picture.set_clip_path(focus)
    if moment.site is not None:
        at = (moment.site[0] * width, moment.site[1] * height)
        if 0 <= at[0] < width and 0 <= at[1] < height:
            cell.plot(*at, 'x', color=_SITE, markersize=14, markeredgewidth=3)
        else:
            edge = np.clip(at, 8, (width - 8, height - 8))
            arrow = {'arrowstyle': '->', 'color': _SITE, 'linewidth': 2}
            cell.annotate('', edge, (width / 2, height / 2), arrowprops=arrow)
