# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A strip of moments: what the camera saw, what the networks said, where the focus lay."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from peace_ros.core.domain import RecordingError
from peace_ros.recording import canvas
from peace_ros.recording.canvas import Image

_CELL_PX = 280
_GAP_PX = 12
_LABEL_PX = 128
_SIDE_PX = 96
_COLUMNS = 6


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
    count = -(-len(moments) // _COLUMNS)
    columns = -(-len(moments) // count)
    rows = [moments[k : k + columns] for k in range(0, len(moments), columns)]
    width = _SIDE_PX + columns * (_CELL_PX + _GAP_PX) + _GAP_PX
    head = canvas.blank(width, 50)
    canvas.put_text(head, title, (_GAP_PX, 33), scale=0.7, thickness=2)
    return np.vstack([head, *(_draw_row(row, width) for row in rows)])


def _draw_row(row: list[FilmMoment], width: int) -> Image:
    sheet = canvas.blank(width, _LABEL_PX + 3 * (_CELL_PX + _GAP_PX) + _GAP_PX)
    for number, name in enumerate(('camera', 'heatmap', 'focus')):
        y = _LABEL_PX + number * (_CELL_PX + _GAP_PX) + _CELL_PX // 2
        canvas.put_text(sheet, name, (_GAP_PX, y), scale=0.5, colour=canvas.FAINT)
    middle = _LABEL_PX + _CELL_PX + _GAP_PX + _CELL_PX // 2
    for number, (name, colour) in enumerate((('safe', 255), ('doubtful', 128), ('unsafe', 0))):
        y = middle + 26 + 20 * number
        shade = canvas.heat_colours(np.full((1, 1), colour, np.uint8))[0, 0]
        cv2.rectangle(sheet, (_GAP_PX, y - 9), (_GAP_PX + 10, y), [int(k) for k in shade], -1)
        canvas.put_text(sheet, name, (_GAP_PX + 16, y), scale=0.4, colour=canvas.FAINT)
    for number, moment in enumerate(row):
        left = _SIDE_PX + number * (_CELL_PX + _GAP_PX)
        _draw_labels(sheet[:_LABEL_PX, left : left + _CELL_PX], moment)
        for k, cell in enumerate((_camera(moment), _heat(moment), _focus(moment))):
            top = _LABEL_PX + k * (_CELL_PX + _GAP_PX)
            sheet[top : top + _CELL_PX, left : left + _CELL_PX] = cell
    return sheet


def _draw_labels(sheet: Image, moment: FilmMoment) -> None:
    canvas.put_text(sheet, moment.state, (0, 24), scale=0.65, thickness=2)
    altitude = 'no altitude' if moment.altitude_agl_m is None else f'{moment.altitude_agl_m:.1f} m'
    canvas.put_text(sheet, f'{altitude}   at {moment.time_s:.1f} s', (0, 48), scale=0.5)
    lines = canvas.wrap(moment.prompt or 'no prompt yet', _CELL_PX, 0.44)
    for number, line in enumerate(lines[:4]):
        canvas.put_text(sheet, line, (0, 70 + 18 * number), scale=0.44, colour=canvas.FAINT)


def _missing(what: str) -> Image:
    cell = np.full((_CELL_PX, _CELL_PX, 3), 50, np.uint8)
    canvas.put_text(cell, what, (70, _CELL_PX // 2), scale=0.5)
    return cell


def _fit(image: NDArray[np.uint8], interpolation: int) -> Image:
    """Scale to the cell, bars above and below where the picture is wider than high."""
    small = canvas.fitted(image, _CELL_PX, interpolation)
    height, width = small.shape[:2]
    cell = canvas.blank(_CELL_PX, _CELL_PX)
    top, left = (_CELL_PX - height) // 2, (_CELL_PX - width) // 2
    cell[top : top + height, left : left + width] = small
    return cell


def _camera(moment: FilmMoment) -> Image:
    if moment.frame_rgb is None:
        return _missing('no frame yet')
    return _fit(moment.frame_rgb, cv2.INTER_AREA)


def _heat(moment: FilmMoment) -> Image:
    if moment.heatmap is None:
        return _missing('no heatmap yet')
    coloured = canvas.heat_colours(moment.heatmap)
    if moment.frame_rgb is not None:
        height, width = moment.frame_rgb.shape[:2]
        coloured = np.asarray(cv2.resize(coloured, (width, height)), np.uint8)
    return _fit(coloured, cv2.INTER_LINEAR)


def _focus(moment: FilmMoment) -> Image:
    """Darken what the landing node does not look at, and mark the site."""
    if moment.frame_rgb is None:
        return _missing('no frame yet')
    picture = moment.frame_rgb.copy()
    height, width = picture.shape[:2]
    thick = max(1, width // 180)
    if moment.focus_radius is not None:
        u, v = moment.focus_centre or (0.5, 0.5)
        centre = (round(u * width), round(v * height))
        radius = max(1, round(moment.focus_radius * width))
        mask = np.zeros((height, width), np.uint8)
        cv2.circle(mask, centre, radius, 255, -1)
        picture[mask == 0] = picture[mask == 0] // 4
        cv2.circle(picture, centre, radius, (255, 255, 255), thick, cv2.LINE_AA)
    if moment.site is not None:
        at = (round(moment.site[0] * width), round(moment.site[1] * height))
        if 0 <= at[0] < width and 0 <= at[1] < height:
            canvas.cross(picture, at, max(10, width // 16), (80, 230, 255))
        else:
            edge = (min(max(at[0], 8), width - 8), min(max(at[1], 8), height - 8))
            middle = (width // 2, height // 2)
            cv2.arrowedLine(picture, middle, edge, (80, 230, 255), thick + 1, cv2.LINE_AA, 0, 0.06)
    return _fit(picture, cv2.INTER_AREA)
