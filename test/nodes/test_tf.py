# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The pose and the mount of the camera by tf; runs where tf2_ros is installed (with ROS)."""

from __future__ import annotations

import time

import numpy as np
import pytest
from geometry_msgs.msg import TransformStamped

from peace_ros.core.domain import ConfigurationError, Pose
from peace_ros.core.domain.geometry import angle_between, mount_from_degrees
from peace_ros.core.transforms import mount_from_transform
from peace_ros.nodes import qos
from peace_ros.nodes.landing import LandingNode
from peace_ros.nodes.messages import header
from peace_ros.nodes.tf import TfMounts

pytest.importorskip('tf2_ros')
TFMessage = pytest.importorskip('tf2_msgs.msg').TFMessage

HALF = 0.5**0.5
NADIR_OPTICAL = (0.0, HALF, -HALF, 0.0)
LEVEL = (1.0, 0.0, 0.0, 0.0)


def transform(at_ns, parent, child, q=LEVEL, at=(0.0, 0.0, 0.0)):
    message = TransformStamped(header=header(at_ns, parent), child_frame_id=child)
    to, turn = message.transform.translation, message.transform.rotation
    to.x, to.y, to.z = at
    turn.w, turn.x, turn.y, turn.z = q
    return message


@pytest.fixture
def tell(bench):
    """Return what publishes transforms, moving ones and static ones."""
    moving = bench.peer.create_publisher(TFMessage, '/tf', qos.POSE)
    static = bench.peer.create_publisher(TFMessage, '/tf_static', qos.LATCHED)

    def publish(*transforms, is_static=False):
        (static if is_static else moving).publish(TFMessage(transforms=list(transforms)))

    return publish


def test_the_pose_is_the_whole_chain_from_map_and_what_is_missing_is_named(bench, tell):
    node = bench.run(LandingNode, interface='twist', pose_source='tf')
    heatmaps = bench.offer_heatmaps()

    def see(*, odometry: bool):
        at_ns = node.clock_ns()
        tell(transform(at_ns, 'odom', 'base_link', LEVEL, (0.0, 0.0, 30.0)))
        if odometry:
            tell(transform(at_ns, 'map', 'odom', LEVEL, (7.0, 0.0, 10.0)))
        heatmaps.publish(np.full((32, 32), 0.97, np.float32), at_ns)

    missing = 'upwards it ends at odom: publish the transform map to odom'
    bench.until(lambda: missing in node.check_engagement(), lambda: see(odometry=False))
    bench.until(lambda: not node.check_engagement(), lambda: see(odometry=True))
    pose = node._access.link.telemetry().pose
    assert (pose.east_m, pose.altitude_agl_m) == pytest.approx((7.0, 40.0))


def test_heatmaps_are_used_once_tf_says_how_the_camera_is_mounted(bench, tell):
    node = bench.run(LandingNode, interface='twist', mount_source='tf')
    see = bench.offer_safe_ground(node, 40.0)
    tell(transform(0, 'camera', 'optical'), is_static=True)
    missing = 'tf does not lead from base_link to optical: upwards it ends at camera'
    bench.until(lambda: missing in node.check_engagement(), see)
    both = (
        transform(0, 'camera', 'optical'),
        transform(0, 'base_link', 'camera', NADIR_OPTICAL, (0.5, 0.0, 0.0)),
    )
    bench.until(lambda: not node.check_engagement(), lambda: (tell(*both, is_static=True), see()))


def test_a_joint_that_moves_counts_at_the_moment_of_each_pose(bench, tell):
    mounts = TfMounts(bench.peer, 'base_link')
    mounts.see('optical')
    begin_ns = time.time_ns()
    tell(transform(0, 'gimbal', 'optical', NADIR_OPTICAL), is_static=True)

    def joint(seconds, pitch_deg):
        w, x, y, z = mount_from_degrees((0.0, pitch_deg, 0.0), (0.0, 0.0, 0.0)).quaternion
        at_ns = begin_ns + round(seconds * 1e9)
        tell(transform(at_ns, 'base_link', 'gimbal', (w, x, -y, -z)))

    def pose(seconds):
        return Pose(begin_ns + round(seconds * 1e9), 0.0, 0.0, -40.0, LEVEL, 40.0)

    def look():
        joint(0.0, 0.0)
        joint(0.2, 10.0)

    bench.until(lambda: list(mounts.of((pose(0.05),))), look)
    found = list(mounts.of((pose(0.1), pose(0.3))))
    (placed, mount) = found[0]
    assert placed.stamp_ns == pose(0.1).stamp_ns
    expected = mount_from_degrees((0.0, 5.0, 0.0), (0.0, 0.0, 0.0))
    assert angle_between(mount.quaternion, expected.quaternion) < 1e-3
    assert len(found) == 1, 'the joint at the second pose is not known yet'
    assert mounts.problem == ''
    assert list(mounts.of((pose(1.0),))) == []
    assert 'tf from base_link to optical' in mounts.problem


def test_tf_and_a_gimbal_cannot_both_say_how_the_camera_is_turned(bench):
    with pytest.raises(ConfigurationError, match='choose one'):
        bench.run(LandingNode, mount_source='tf', vehicle__follow_gimbal=True)


def test_the_landing_publishes_the_vehicle_and_its_camera(bench):
    heard = bench.heard(TFMessage, '/tf', qos.RESULT)
    node = bench.run(LandingNode, interface='twist', publish_tf=True, mount_x=0.5)
    see = bench.offer_safe_ground(node, 40.0, east_m=3.0)
    bench.until(lambda: any(len(each.transforms) == 2 for each in heard), see)
    vehicle, camera = next(each.transforms for each in heard if len(each.transforms) == 2)
    assert (vehicle.header.frame_id, vehicle.child_frame_id) == ('map', 'base_link')
    assert (vehicle.transform.translation.x, vehicle.transform.translation.z) == (3.0, 40.0)
    assert (camera.header.frame_id, camera.child_frame_id) == ('base_link', 'optical')
    mount = mount_from_transform(camera)
    assert mount.offset_frd_m == pytest.approx((0.5, 0.0, 0.0))
    assert angle_between(mount.quaternion, LEVEL) < 1e-6
