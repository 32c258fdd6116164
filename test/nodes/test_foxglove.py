# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The layout for Foxglove shows topics, fields and panels that there are."""

from __future__ import annotations

import json
import re
from importlib import import_module
from pathlib import Path as FilePath

from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PointStamped, PoseStamped, TwistStamped
from nav_msgs.msg import OccupancyGrid, Path
from sensor_msgs.msg import CameraInfo, CompressedImage
from visualization_msgs.msg import MarkerArray

ROOT = FilePath(__file__).resolve().parents[2]

FOXGLOVE_TOPICS = {
    '/landing/map': OccupancyGrid,
    '/landing/markers': MarkerArray,
    '/landing/path': Path,
    '/landing/pose': PoseStamped,
    '/landing/site': PointStamped,
    '/landing/setpoint': TwistStamped,
    '/landing/status': DiagnosticArray,
    '/overlay/compressed': CompressedImage,
    '/heatmap/frame_info': CameraInfo,
    '/prompt': DiagnosticArray,
    '/diagnostics': DiagnosticArray,
}


def message_paths(value):
    """Every text of a layout that begins with a topic."""
    if isinstance(value, dict):
        return [
            *filter(is_topic, value),
            *(p for each in value.values() for p in message_paths(each)),
        ]
    if isinstance(value, list):
        return [path for each in value for path in message_paths(each)]
    return [value] if is_topic(value) else []


def is_topic(value):
    return isinstance(value, str) and value.startswith('/')


def test_foxglove_shows_topics_and_fields_that_there_are():
    layout = json.loads((ROOT / 'config' / 'foxglove' / 'peace.json').read_text())
    paths = message_paths(layout['configById'])
    assert {path.partition('.')[0] for path in paths} == set(FOXGLOVE_TOPICS)
    for path in paths:
        topic, _, fields = re.sub(r'\[[^]]*\]|\{[^}]*\}', '', path).partition('.')
        kind = FOXGLOVE_TOPICS[topic]
        for field in filter(None, fields.split('.')):
            told = kind.get_fields_and_field_types()[field]
            inner = re.search(r'(\w+)/(\w+)', told)
            if inner is not None:
                kind = getattr(import_module(f'{inner[1]}.msg'), inner[2])


def test_every_panel_of_foxglove_has_its_place_and_its_settings():
    layout = json.loads((ROOT / 'config' / 'foxglove' / 'peace.json').read_text())

    def panels(part):
        if isinstance(part, str):
            return [part]
        return [*panels(part['first']), *panels(part['second'])]

    assert sorted(panels(layout['layout'])) == sorted(layout['configById'])
