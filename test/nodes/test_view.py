# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What people see of a landing: map, places, pose and path, in the frames of REP-103."""

from __future__ import annotations

from pathlib import Path as FilePath

import numpy as np
import pytest
import yaml
from geometry_msgs.msg import PoseStamped
from nav_msgs.msg import OccupancyGrid, Path
from rclpy.qos import DurabilityPolicy
from sensor_msgs.msg import CompressedImage
from visualization_msgs.msg import Marker, MarkerArray

from peace_ros.core.mapping import MapLayers
from peace_ros.nodes import qos
from peace_ros.nodes.landing import LandingNode
from peace_ros.nodes.segmentation import SegmentationNode
from peace_ros.nodes.view_messages import grid_message, markers_message

ROOT = FilePath(__file__).resolve().parents[2]


def test_the_grid_grows_to_the_east_and_to_the_north():
    score = np.array([[1.0, 0.0, 0.25], [0.0, 0.0, 0.9]], np.float32)
    age_s = np.array([[0.1, 0.1, 0.1], [np.inf, 0.1, 0.1]], np.float32)
    looks, never = np.ones((2, 3), np.uint16), np.full((2, 3), np.inf, np.float32)
    layers = MapLayers(score, age_s, looks, 0.5, -4.0, 7.0, never)
    grid = grid_message(layers, 1_500_000_000, up_m=2.0)
    assert (grid.info.width, grid.info.height, grid.info.resolution) == (3, 2, 0.5)
    origin = grid.info.origin.position
    assert (origin.x, origin.y, origin.z) == (7.0, -4.0, 2.0)
    assert list(grid.data) == [0, 100, 75, -1, 100, 10]
    assert (grid.header.frame_id, grid.header.stamp.sec) == ('map', 1)


PLACES = [('site', 3.0, 4.0, 2.5), ('failed', 0.0, -1.0, 6.0)]


def test_markers_lie_where_the_places_are_and_replace_those_before():
    markers = markers_message(PLACES, (), 7, 1.0).markers
    assert markers[0].action == Marker.DELETEALL
    at = markers[1].pose.position
    assert (at.x, at.y, at.z) == (4.0, 3.0, 1.0)
    assert (markers[1].ns, markers[1].scale.x, markers[2].scale.y) == ('site', 5.0, 12.0)
    assert len({(each.ns, each.id) for each in markers[1:]}) == 2


def test_the_way_of_the_search_is_a_line_on_the_ground():
    *_, line = markers_message(PLACES, ((0.0, 0.0), (30.0, -5.0)), 7, 1.0).markers
    assert (line.ns, line.type) == ('search', Marker.LINE_STRIP)
    assert [(each.x, each.y, each.z) for each in line.points] == [
        (0.0, 0.0, 1.0),
        (-5.0, 30.0, 1.0),
    ]


def test_a_landing_shows_map_places_pose_and_path(bench):
    heard = {
        kind: bench.heard(kind, f'landing/{name}', profile)
        for kind, name, profile in (
            (OccupancyGrid, 'map', qos.LATCHED),
            (MarkerArray, 'markers', qos.RESULT),
            (PoseStamped, 'pose', qos.RESULT),
            (Path, 'path', qos.RESULT),
        )
    }
    node = bench.run(LandingNode, interface='twist')
    see = bench.offer_safe_ground(node, 40.0, north_m=5.0, east_m=2.0)
    bench.until(lambda: all(heard.values()), see)
    at = heard[PoseStamped][-1].pose.position
    assert (at.x, at.y, at.z) == pytest.approx((2.0, 5.0, 40.0))
    bench.until(lambda: min(heard[OccupancyGrid][-1].data) == -1, see)
    bench.until(
        lambda: 0 <= np.median([v for v in heard[OccupancyGrid][-1].data if v >= 0]) < 20, see
    )
    bench.until(
        lambda: {'site', 'focus'} <= {each.ns for each in heard[MarkerArray][-1].markers}, see
    )
    late = bench.heard(OccupancyGrid, 'landing/map', qos.LATCHED)
    bench.until(lambda: bool(late))
    assert len(heard[Path][-1].poses) >= 1


def test_tf_that_cannot_be_published_is_said(bench, capfd, monkeypatch):
    monkeypatch.setitem(__import__('sys').modules, 'tf2_msgs.msg', None)
    bench.run(LandingNode, interface='twist', publish_tf=True)
    assert 'tf2_msgs is not installed: /tf is not published' in capfd.readouterr().err


RVIZ = {
    'Map': OccupancyGrid,
    'MarkerArray': MarkerArray,
    'Path': Path,
    'Pose': PoseStamped,
    'Image': CompressedImage,
}
"""What each display of RViz subscribes to; Image takes the transport that ends the name."""
DURABILITY = {
    'Transient Local': DurabilityPolicy.TRANSIENT_LOCAL,
    'Volatile': DurabilityPolicy.VOLATILE,
}


def test_rviz_shows_topics_that_the_nodes_publish_with_their_types(bench):
    bench.run(LandingNode, interface='twist')
    bench.run(SegmentationNode, object(), template='DD')
    shown = yaml.safe_load((ROOT / 'config' / 'rviz' / 'peace.rviz').read_text())
    displays = shown['Visualization Manager']['Displays']
    assert {each['Class'].rpartition('/')[2] for each in displays} == set(RVIZ)
    for each in displays:
        topic, kind = each['Topic'], RVIZ[each['Class'].rpartition('/')[2]]
        name = f'/{topic["Value"]}'
        bench.until(lambda name=name: bench.peer.count_publishers(name) == 1)
        (found,) = bench.peer.get_publishers_info_by_topic(name)
        assert found.topic_type == f'{kind.__module__.partition(".")[0]}/msg/{kind.__name__}'
        wanted = DURABILITY[topic['Durability Policy']]
        assert wanted in {found.qos_profile.durability, DurabilityPolicy.VOLATILE}, name
