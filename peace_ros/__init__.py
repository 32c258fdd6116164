# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""PEACE: find a place below a drone where landing hurts nobody, and go there.

from peace_ros import Pipeline, read_image

pipeline = Pipeline.from_preset('peace_cs')
heatmap = pipeline.segment(read_image('photo.jpg'))
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from peace_ros.core.domain import Frame
    from peace_ros.core.images import read_image
    from peace_ros.core.pipeline import Pipeline
    from peace_ros.core.segmentation import draw_overlay

__version__ = '0.1.0'
__all__ = ['Frame', 'Pipeline', 'draw_overlay', 'read_image']

_HOME = {
    'Frame': 'domain',
    'Pipeline': 'pipeline',
    'draw_overlay': 'segmentation',
    'read_image': 'images',
}
"""Name -> module of the core, imported when the name is first used: ``peace --help`` is quick."""


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        raise AttributeError(f'module {__name__!r} has no attribute {name!r}')
    return getattr(import_module(f'{__name__}.core.{_HOME[name]}'), name)


def __dir__() -> list[str]:
    return sorted([*globals(), *__all__])
