# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Pictures of moments of a recording, as several replays of it saw them."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Iterator, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from peace_ros.core.domain import Frame, Heatmap
from peace_ros.core.segmentation import draw_overlay
from peace_ros.lab.replay.run import ReplayOptions
from peace_ros.lab.replay.source import open_source
from peace_ros.lab.replay.trace import Trace
from peace_ros.recording.contact_sheet import Cell, draw_contact_sheet


def moment_sheets(
    options: ReplayOptions, traces: Mapping[str, Trace], moments_ns: Sequence[int], title: str
) -> Iterator[NDArray[np.uint8]]:
    """Yield a sheet for each moment: the frame, and what each replay made of it.

    Args:
        options: of the replays; the recording is read once more.
        traces: name -> replay.
        moments_ns: stamps.
        title: of each sheet; the time is added.
    """
    for at_ns, frame in _frames_at(options, sorted(moments_ns)):
        cells = [
            Cell(frame.image_rgb, f'frame at {frame.stamp_ns * 1e-9:.1f} s', options.source.name),
            *(_cell(name, trace, frame, at_ns) for name, trace in traces.items()),
        ]
        yield draw_contact_sheet(cells, f'{title} at {at_ns * 1e-9:.1f} s')


def _frames_at(options: ReplayOptions, moments_ns: list[int]) -> Iterator[tuple[int, Frame]]:
    """Yield each moment with the last usable frame up to it, or the first one."""
    waiting, newest = list(moments_ns), None
    for taken in open_source(options.source, options.part).frames():
        while waiting and newest is not None and taken.stamp_ns > waiting[0]:
            yield waiting.pop(0), newest
        if not waiting:
            return
        newest = taken.frame or newest
    if newest is not None:
        yield from ((each, newest) for each in waiting)


def _cell(name: str, trace: Trace, frame: Frame, at_ns: int) -> Cell:
    """Return the frame as a replay saw it, with its decision of the moment."""
    index = int(np.searchsorted(trace.frame_stamps_ns, frame.stamp_ns))
    is_there = index < len(trace.masks) and trace.frame_stamps_ns[index] == frame.stamp_ns
    step = bisect_right(trace.step_stamps_ns.tolist(), at_ns) - 1
    state, told = 'no decision', ''
    if step >= 0:
        north_m, east_m = trace.sites_m[step]
        state = trace.states[step]
        place = f'site {north_m:.1f} N, {east_m:.1f} E m' if np.isfinite(north_m) else 'no site'
        north, east, down = trace.setpoints_m_s[step]
        told = f'{place}; set-point {north:.2f} N, {east:.2f} E, {down:.2f} down m/s; '
    if not is_there:
        return Cell(frame.image_rgb, f'{name}: {state}, no heatmap', told)
    heatmap = Heatmap(trace.safe(index).astype(np.float32), frame.stamp_ns)
    return Cell(draw_overlay(frame, heatmap), f'{name}: {state}', told + trace.prompts[index])
