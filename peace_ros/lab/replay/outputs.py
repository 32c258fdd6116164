# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What a replay writes: a bag of the same topics as in flight, a contact sheet, a video."""

from __future__ import annotations

from contextlib import ExitStack
from pathlib import Path
from types import TracebackType
from typing import final

import cv2
import numpy as np
from numpy.typing import NDArray

from peace_ros.core.landing.pairs import decision_pairs
from peace_ros.core.pipeline import SegmentedFrame
from peace_ros.core.prompting.pairs import prompt_pairs
from peace_ros.core.segmentation import draw_overlay
from peace_ros.lab.replay.line import Step
from peace_ros.recording import BagWriter, VideoWriter, save_picture
from peace_ros.recording.contact_sheet import Cell, draw_contact_sheet
from peace_ros.recording.messages import diagnostic_array, heatmap_to_image, jpeg_message

_CELLS = 20
_OK, _WARN = 0, 1
QUIET_STATES = frozenset({'HOLD', 'ABORTED'})


@final
class ReplayOutputs:
    """The files of a replay; a bag and a video appear under their names only when whole."""

    def __init__(self, folder: Path, frames: int, video_hz: float | None, title: str) -> None:
        """Prepare the files.

        Args:
            folder: exists already.
            frames: about how many frames will come, to spread the contact sheet over them.
            video_hz: frame rate of the overlay video; None writes none.
            title: of the contact sheet.
        """
        self._folder = folder
        self._every = max(1, frames // _CELLS)
        self._title = title
        self._files = ExitStack()
        self._bag = BagWriter(folder / 'replay.mcap')
        self._video = VideoWriter(folder / 'overlays.mp4', video_hz) if video_hz else None
        self._cells: list[Cell] = []
        self._looks = 0
        self._caption = ''

    def __enter__(self) -> ReplayOutputs:
        """Create the files."""
        self._files.enter_context(self._bag)
        if self._video is not None:
            self._files.enter_context(self._video)
        return self

    def __exit__(
        self,
        error_type: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """Finish the files, or remove them after an error."""
        self._files.__exit__(error_type, error, trace)
        if error_type is None and self._cells:
            sheet = draw_contact_sheet(self._cells, self._title)
            save_picture(sheet, self._folder / 'overlays.png')

    def add_look(self, look: SegmentedFrame, step: Step | None) -> None:
        """Write prompt, heatmap and overlay of a frame; ``step`` is the newest decision."""
        stamp_ns = look.frame.stamp_ns
        values = prompt_pairs(look.prompt).items()
        message = diagnostic_array(stamp_ns, 'prompt', _OK, look.prompt.template, values)
        self._bag.write('/prompt', stamp_ns, message)
        self._bag.write('/heatmap', stamp_ns, heatmap_to_image(look.heatmap))
        overlay = draw_overlay(look.frame, look.heatmap)
        self._bag.write('/overlay/compressed', stamp_ns, jpeg_message(overlay, stamp_ns))
        caption = _caption(step)
        if self._looks % self._every == 0 and len(self._cells) < _CELLS:
            self._cells.append(Cell(overlay, caption, look.prompt.template))
        if self._video is not None:
            self._video.write(_captioned(overlay, caption))
        self._looks += 1

    def add_step(self, step: Step) -> None:
        """Write a decision as ``landing/status``."""
        decision = step.decision
        level = _WARN if decision.state.value in QUIET_STATES else _OK
        pairs = decision_pairs(decision, step.pose).items()
        message = diagnostic_array(step.stamp_ns, 'landing', level, decision.reason, pairs)
        self._bag.write('/landing/status', step.stamp_ns, message)


def _caption(step: Step | None) -> str:
    if step is None:
        return 'first frame'
    altitude = '' if step.pose is None else f'  {step.pose.altitude_agl_m:.1f} m'
    return f'{step.decision.state.value}{altitude}'


def _captioned(image: NDArray[np.uint8], caption: str) -> NDArray[np.uint8]:
    picture: NDArray[np.uint8] = image.copy()
    for colour, thickness in ((0, 0, 0), 3), ((235, 235, 235), 1):
        at, font = (8, 20), cv2.FONT_HERSHEY_SIMPLEX
        cv2.putText(picture, caption, at, font, 0.5, colour, thickness, cv2.LINE_AA)
    return picture
