# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Many small pictures with captions on one sheet."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from peace_ros.core.domain import RecordingError
from peace_ros.recording import canvas
from peace_ros.recording.canvas import Image

_CELL_PX = 300
_CAPTION_PX = 62
_GAP_PX = 10
_COLUMNS = 5


@dataclass(frozen=True)
class Cell:
    """One picture of a sheet."""

    image_rgb: NDArray[np.uint8]
    """Height x width x 3."""
    caption: str
    """First line, larger."""
    detail: str = ''


def draw_contact_sheet(cells: list[Cell], title: str) -> Image:
    """Draw the cells in rows of five.

    Raises:
        RecordingError: there is no cell at all.

    """
    if not cells:
        raise RecordingError('a contact sheet of 0 pictures cannot be drawn: nothing was seen')
    columns = min(_COLUMNS, len(cells))
    rows = -(-len(cells) // columns)
    width = columns * (_CELL_PX + _GAP_PX) + _GAP_PX
    sheet = canvas.blank(width, 50 + rows * (_CELL_PX + _CAPTION_PX + _GAP_PX))
    canvas.put_text(sheet, title, (_GAP_PX, 33), scale=0.65, thickness=2)
    for number, cell in enumerate(cells):
        row, column = divmod(number, columns)
        left = _GAP_PX + column * (_CELL_PX + _GAP_PX)
        top = 50 + row * (_CELL_PX + _CAPTION_PX + _GAP_PX)
        canvas.put_text(sheet, cell.caption, (left, top + 18), scale=0.5, thickness=1)
        lines = canvas.wrap(cell.detail, _CELL_PX, 0.4)
        for k, line in enumerate(lines[:2]):
            canvas.put_text(sheet, line, (left, top + 36 + 16 * k), scale=0.4, colour=canvas.FAINT)
        picture = canvas.fitted(cell.image_rgb, _CELL_PX)
        y = top + _CAPTION_PX
        sheet[y : y + picture.shape[0], left : left + picture.shape[1]] = picture
    return sheet
