# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Many small pictures with captions on one sheet."""

from __future__ import annotations

import textwrap
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
_LETTERS = 48
"""In a line of details."""


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
    wide, high = _CELL_PX + _GAP_PX, _CELL_PX + _CAPTION_PX + _GAP_PX
    sheet = canvas.sheet(columns * wide + _GAP_PX, 50 + rows * high)
    canvas.write(sheet, _GAP_PX, 33, title, 11, weight='bold')
    for number, cell in enumerate(cells):
        row, column = divmod(number, columns)
        left, top = _GAP_PX + column * wide, 50 + row * high
        canvas.write(sheet, left, top + 18, cell.caption, 9)
        detail = '\n'.join(textwrap.wrap(cell.detail, _LETTERS)[:2])
        canvas.write(sheet, left, top + 36, detail, 7, color=canvas.FAINT)
        window = canvas.window(sheet, left, top + _CAPTION_PX, _CELL_PX, _CELL_PX)
        window.imshow(cell.image_rgb).axes.set_anchor('NW')
    return canvas.pixels(sheet)
