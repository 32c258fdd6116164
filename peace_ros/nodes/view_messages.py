# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Messages for people who look: map, places and search of a landing, transforms."""

from __future__ import annotations

from array import array
from collections.abc import Sequence
from importlib import import_module
from typing import Any

import numpy as np
from geometry_msgs.msg import Point, TransformStamped

from peace_ros.core.domain import Site
from peace_ros.core.domain.camera import Quaternion
from peace_ros.core.domain.geometry import ned_to_enu
from peace_ros.core.landing import Decision, LandingCore
from peace_ros.core.mapping import MapLayers
from peace_ros.nodes.messages import LOCAL_FRAME, header

_HEIGHT_M = 0.2
_LINE_M = 0.3
_COLOURS = {
    'site': (0.0, 0.8, 0.2, 0.8),
    'candidate': (0.1, 0.4, 1.0, 0.5),
    'failed': (0.9, 0.1, 0.1, 0.5),
    'focus': (1.0, 1.0, 1.0, 0.1),
    'search': (1.0, 0.8, 0.0, 0.8),
}
"""Red, green, blue, opacity, each 0 to 1."""
_Circle = tuple[str, float, float, float]
"""Kind, north and east of the middle, radius; metres."""


def transform_message(
    stamp_ns: int,
    parent: str,
    child: str,
    placed: tuple[Quaternion, tuple[float, float, float]],
) -> TransformStamped:
    """Return a transform: rotation (w, x, y, z) and translation (m) of the child frame."""
    message = TransformStamped(header=header(stamp_ns, parent), child_frame_id=child)
    turn, at = message.transform.rotation, message.transform.translation
    (turn.w, turn.x, turn.y, turn.z), (at.x, at.y, at.z) = placed
    return message


def circles(decision: Decision, core: LandingCore) -> list[_Circle]:
    """Return what the landing knows of places: site, candidates, failed places, focus."""

    def of_site(kind: str, site: Site) -> _Circle:
        return kind, site.north_m, site.east_m, site.clearance_m

    found = [of_site('candidate', each) for each in core.seen_sites]
    found += [('failed', each.north_m, each.east_m, each.radius_m) for each in core.failed_places]
    if decision.site is not None:
        found.append(of_site('site', decision.site))
    if decision.focus is not None:
        focus = decision.focus
        found.append(('focus', focus.north_m, focus.east_m, focus.radius_m))
    return found


def grid_message(layers: MapLayers, at_ns: int, up_m: float) -> Any:
    """Return the nav_msgs/OccupancyGrid of a map: 0 safe, 100 unsafe, -1 unknown.

    Args:
        layers: rows x columns, to the north and to the east.
        at_ns: stamp.
        up_m: height of the ground in the local frame.
    """
    message = import_module('nav_msgs.msg').OccupancyGrid(header=header(at_ns, LOCAL_FRAME))
    cells = np.rint(100.0 * (1.0 - layers.score)).astype(np.int8)
    cells[~np.isfinite(layers.age_s)] = -1
    message.info.map_load_time = message.header.stamp
    message.info.resolution = layers.cell_m
    message.info.height, message.info.width = cells.shape
    origin = message.info.origin.position
    origin.x, origin.y, origin.z = layers.west_m, layers.south_m, up_m
    message.data = array('b', cells.tobytes())
    return message


def markers_message(
    places: Sequence[_Circle], search: Sequence[tuple[float, float]], at_ns: int, up_m: float
) -> Any:
    """Return the visualization_msgs/MarkerArray of places, and of no other.

    Args:
        places: circles on the ground.
        search: way-points (north, east) of the search, in order; may be empty.
        at_ns: stamp.
        up_m: height of the ground in the local frame.
    """
    messages = import_module('visualization_msgs.msg')
    markers = [messages.Marker(header=header(at_ns, LOCAL_FRAME), action=messages.Marker.DELETEALL)]
    for number, (kind, north_m, east_m, radius_m) in enumerate(places):
        marker = messages.Marker(header=header(at_ns, LOCAL_FRAME), ns=kind, id=number)
        marker.type = messages.Marker.CYLINDER
        at = marker.pose.position
        at.x, at.y, at.z = ned_to_enu(north_m, east_m, -up_m)
        marker.scale.x = marker.scale.y = 2.0 * radius_m
        marker.scale.z = _HEIGHT_M
        colour = marker.color
        colour.r, colour.g, colour.b, colour.a = _COLOURS[kind]
        markers.append(marker)
    if search:
        line = messages.Marker(header=header(at_ns, LOCAL_FRAME), ns='search')
        line.type, line.scale.x = messages.Marker.LINE_STRIP, _LINE_M
        line.color.r, line.color.g, line.color.b, line.color.a = _COLOURS['search']
        ground = (ned_to_enu(north_m, east_m, -up_m) for north_m, east_m in search)
        line.points = [Point(x=x, y=y, z=z) for x, y, z in ground]
        markers.append(line)
    return messages.MarkerArray(markers=markers)
