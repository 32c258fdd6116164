# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What the package does with a file of each kind, as a user would have it."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from peace_ros.core.presets import load_preset
from peace_ros.lab.evaluation.segmentation.errors import SampleError
from peace_ros.lab.evaluation.segmentation.samples import manifest_source
from peace_ros.lab.replay import ReplayOptions, SourceOptions, replay
from peace_ros.recording.flight_log import LOG_SUFFIXES, read_flight_log
from peace_ros.recording.storages import STORAGES
from peace_ros.recording.video import VIDEO_SUFFIXES
from peace_ros.simulation.rasters import IMAGE_SUFFIXES, read_indices, read_photo

Reader = Callable[[Path, Path], None]
"""Called with the file and a folder for results that does not exist yet."""
_FRAMES = 3


def _replay(path: Path, out: Path) -> None:
    replay(ReplayOptions(path, 'dd_cs', out, SourceOptions(limit=_FRAMES)))


def _log(path: Path, _out: Path) -> None:
    read_flight_log(path)


def _picture(path: Path, _out: Path) -> None:
    read_photo(path)
    read_indices(path)


def _preset(path: Path, _out: Path) -> None:
    load_preset(str(path))


def _manifest(path: Path, _out: Path) -> None:
    for sample in manifest_source(path, '', 'common', 'ignore').samples:
        try:
            sample.load()
        except SampleError:  # noqa: PERF203 (one bad pair among many)
            continue


READERS: dict[str, Reader] = {
    **dict.fromkeys((*STORAGES, *VIDEO_SUFFIXES), _replay),
    **dict.fromkeys(LOG_SUFFIXES, _log),
    **dict.fromkeys(IMAGE_SUFFIXES, _picture),
    '.yaml': _preset,
    '.csv': _manifest,
}
"""Suffix of a file -> what reads it."""
