# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The simulated camera and autopilot as nodes: stamps, places, clock."""

from __future__ import annotations

from itertools import pairwise
from math import pi, radians

import cv2
import numpy as np
import pytest
from geometry_msgs.msg import PoseStamped, Twist
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import CameraInfo, Image

from peace_ros.core.domain import ConfigurationError, PeaceError, Pose, VehicleError, WorldError
from peace_ros.core.domain.geometry import yaw_from_quaternion
from peace_ros.core.messages import frame_from_message, ns_from_time, pose_from_message, stamp_ns_of
from peace_ros.core.node_parameters import LandingOptions
from peace_ros.core.vehicle import open_vehicle
from peace_ros.nodes import qos
from peace_ros.nodes.messages import pose_to_message
from peace_ros.simulation.autopilot import AutopilotParameters, AutopilotSim
from peace_ros.simulation.demo.isolation import free_udp_port
from peace_ros.simulation.nodes.autopilot_sim import AutopilotSimNode
from peace_ros.simulation.nodes.options import AutopilotSimOptions
from peace_ros.simulation.nodes.satellite_view import SatelliteViewNode
from peace_ros.simulation.nodes.twist_vehicle import TwistVehicle

LEVEL = (1.0, 0.0, 0.0, 0.0)


@pytest.fixture
def world(tmp_path):
    """Return a file of 100 m x 100 m: the north-east quarter is red, the rest is blue."""
    image = np.zeros((200, 200, 3), np.uint8)
    image[...] = (255, 0, 0)
    image[:100, 100:] = (0, 0, 255)
    path = tmp_path / 'world.png'
    cv2.imwrite(str(path), image)
    return str(path)


def at(stamp: int, north: float, east: float, altitude: float = 20.0):
    return pose_to_message(Pose(stamp, north, east, -altitude, LEVEL, altitude))


def test_shows_the_ground_below_the_pose_with_its_stamp(bench, world):
    images = bench.heard(Image, 'image', qos.IMAGE_IN)
    infos = bench.heard(CameraInfo, 'camera_info', qos.RESULT)
    node = bench.run(
        SatelliteViewNode, world=world, gsd=0.5, start_x=10.0, start_y=-5.0, camera_width=64
    )
    poses = bench.offer(PoseStamped, 'ground_truth/pose', qos.POSE)
    # The local origin lies 10 m east and 5 m south of the centre, so this is (20, 25) in the world.
    bench.until(lambda: bool(images), lambda: poses.publish(at(111, 25.0, 15.0)))
    frame = frame_from_message(images[0])
    assert frame.stamp_ns == 111
    assert frame.image_rgb.shape == (352, 64, 3)
    assert tuple(frame.image_rgb[176, 32]) == (255, 0, 0)
    bench.until(lambda: bool(infos))
    assert stamp_ns_of(infos[0]) == 111
    images.clear()
    bench.until(lambda: bool(images), lambda: poses.publish(at(2_000_000_000, -20.0, -30.0)))
    assert tuple(frame_from_message(images[-1]).image_rgb[176, 32]) == (0, 0, 255)
    assert node.failure is None


def test_keeps_its_rate_by_the_stamps(bench, world):
    images = bench.heard(Image, 'image', qos.IMAGE_IN)
    bench.run(SatelliteViewNode, world=world, gsd=0.5, rate=10.0, camera_width=64, camera_height=64)
    poses = bench.offer(PoseStamped, 'ground_truth/pose', qos.POSE)
    step_ns, stamps = 33_000_000, iter(range(10**9, 10**10, 33_000_000))
    bench.until(lambda: len(images) >= 12, lambda: poses.publish(at(next(stamps), 0.0, 0.0)))
    gaps = np.diff([stamp_ns_of(each) for each in images])
    assert gaps.min() >= 2 * step_ns
    assert abs(gaps.mean() - 1e8) < 0.2e8


def test_says_once_that_the_world_is_mirrored(bench, world, capfd):
    images = bench.heard(Image, 'image', qos.IMAGE_IN)
    bench.run(SatelliteViewNode, world=world, gsd=0.5, rate=100.0)
    poses = bench.offer(PoseStamped, 'ground_truth/pose', qos.POSE)
    stamps = iter(range(10**9, 10**11, 10**8))
    bench.until(lambda: len(images) >= 3, lambda: poses.publish(at(next(stamps), 0.0, 0.0, 200.0)))
    assert capfd.readouterr().err.count('mirroring') == 1


def test_flies_by_twist_and_publishes_the_pose(bench, world):
    images = bench.heard(Image, 'image', qos.IMAGE_IN)
    poses = bench.heard(PoseStamped, 'pose', qos.POSE)
    bench.run(SatelliteViewNode, world=world, gsd=0.5, pose_source='twist', start_altitude=50.0)
    commands = bench.offer(Twist, 'cmd_vel', qos.COMMAND)
    command = Twist()
    command.linear.x, command.linear.z = 3.0, -2.0
    bench.until(
        lambda: bool(poses) and pose_from_message(poses[-1]).altitude_agl_m < 49.5,
        lambda: commands.publish(command),
    )
    assert pose_from_message(poses[-1]).north_m > 0.5
    assert pose_from_message(poses[-1]).east_m == pytest.approx(0.0)
    bench.until(lambda: bool(images))


@pytest.mark.parametrize('origin_m', [0.0, -9.0])
def test_follows_an_autopilot_and_publishes_its_pose(bench, world, take_off, origin_m):
    images = bench.heard(Image, 'image', qos.IMAGE_IN)
    poses = bench.heard(PoseStamped, 'pose', qos.POSE)
    start = {'start_north_m': 12.0, 'start_east_m': -7.0, 'start_heading_deg': 40.0}
    start['origin_above_home_m'] = origin_m
    with AutopilotSim(AutopilotParameters(port=0, speed=25.0, **start)) as sim:
        node = bench.run(SatelliteViewNode, world=world, gsd=0.5, pose_mavlink=sim.url)
        take_off(sim.url, 30.0)

        def agrees():
            told_m = pose_from_message(poses[-1]).altitude_agl_m if poses else 0.0
            return told_m > 28.0 and abs(told_m - sim.truth().altitude_agl_m) < 0.5

        bench.until(agrees)
        truth, pose = sim.truth(), pose_from_message(poses[-1])
    assert (pose.north_m, pose.east_m) == pytest.approx((truth.north_m, truth.east_m), abs=0.5)
    same = np.dot(pose.quaternion_ned_frd, truth.quaternion_ned_frd)
    assert abs(same) > 0.999
    assert yaw_from_quaternion(pose.quaternion_ned_frd) == pytest.approx(radians(40.0), abs=0.05)
    stamps = [stamp_ns_of(each) for each in poses]
    assert all(later > earlier for earlier, later in pairwise(stamps))
    assert abs(node.clock_ns() - stamps[-1]) < 5e9
    assert {stamp_ns_of(each) for each in images} & set(stamps)


def test_the_pose_of_a_signing_autopilot_needs_its_key(bench, world, tmp_path, capfd):
    key_file = tmp_path / 'key'
    key_file.write_text('a passphrase for the tests')
    poses = bench.heard(PoseStamped, 'pose', qos.POSE)
    signed = AutopilotParameters(port=0, speed=25.0, signing_key_file=str(key_file))
    with AutopilotSim(signed) as sim:
        options = {'world': world, 'gsd': 0.5, 'pose_mavlink': sim.url}
        bench.run(SatelliteViewNode, **options)
        bench.until(lambda: 'no HEARTBEAT of an autopilot' in capfd.readouterr().err)
        assert not poses
        assert sim.refused_signatures > 0
        bench.run(SatelliteViewNode, **options, pose_signing_key_file=str(key_file))
        bench.until(lambda: bool(poses))
    assert (tmp_path / 'key.254.time').is_file()


def test_the_camera_says_after_3_s_why_it_shows_nothing(bench, world, capfd):
    said = ''

    def hears(*words):
        nonlocal said
        said += capfd.readouterr().err
        return all(word in said for word in words)

    with AutopilotSim(AutopilotParameters(port=0, speed=1.0)) as sim:
        sim.lose_gps()
        bench.run(SatelliteViewNode, world=world, gsd=0.5, pose_mavlink=sim.url)
        bench.until(
            lambda: hears(
                'waiting for the camera: the autopilot tells no position because',
                'it needs GNSS (fix type',
            )
        )
    bench.run(SatelliteViewNode, world=world, gsd=0.5)
    bench.until(lambda: hears('nothing publishes ground_truth/pose'))


def test_a_px4_at_rest_has_a_position_and_the_camera_shows_the_ground(bench, world):
    images = bench.heard(Image, 'image', qos.IMAGE_IN)
    with AutopilotSim(AutopilotParameters(port=0, speed=25.0, autopilot='px4')) as sim:
        bench.run(SatelliteViewNode, world=world, gsd=0.5, pose_mavlink=sim.url)
        bench.until(lambda: bool(images))
        assert sim.flight.landed


def test_a_world_that_is_missing_is_refused(bench):
    with pytest.raises(WorldError, match=r'none\.png'):
        bench.run(SatelliteViewNode, world='/none.png', gsd=0.5)


@pytest.mark.parametrize(
    ('given', 'word'), [({'labels': 'x.png'}, 'labels'), ({'pose_source': 'mavlink'}, 'mavlink')]
)
def test_options_that_make_no_sense_are_refused(bench, given, word):
    with pytest.raises(ConfigurationError, match=word):
        bench.run(SatelliteViewNode, **given)


def test_the_autopilot_publishes_pose_and_clock_on_its_own_time(bench):
    poses = bench.heard(PoseStamped, 'ground_truth/pose', qos.POSE)
    clocks = bench.heard(Clock, '/clock', qos.CLOCK)
    bench.run(AutopilotSimNode, port=0, speed=5.0, pose_rate=40.0)
    bench.until(lambda: len(poses) >= 30 and len(clocks) >= 30)
    stamps = [stamp_ns_of(each) for each in poses]
    assert all(later > earlier for earlier, later in pairwise(stamps))
    assert np.median(np.diff(stamps)) == pytest.approx(25e6, rel=0.5)
    ticks = [ns_from_time(each.clock) for each in clocks]
    assert ticks == sorted(ticks)
    assert abs(ticks[-1] - stamps[-1]) < 2e9
    assert ticks[0] > 1_000_000_000_000_000_000


def test_at_wall_speed_there_is_no_clock_and_stamps_are_of_the_node(bench):
    poses = bench.heard(PoseStamped, 'ground_truth/pose', qos.POSE)
    clocks = bench.heard(Clock, '/clock', qos.CLOCK)
    node = bench.run(AutopilotSimNode, port=0)
    bench.until(lambda: len(poses) >= 10)
    assert not clocks
    assert abs(node.clock_ns() - stamp_ns_of(poses[-1])) < 5e9


def test_the_autopilot_and_the_landing_find_each_other_by_default():
    options, landing = AutopilotSimOptions(), LandingOptions()
    assert options.ground_station.removeprefix('udpout:') == landing.mavlink.removeprefix('udpin:')
    assert AutopilotParameters().port != options.ground_station_address[1]


def test_the_autopilot_sends_to_a_ground_station_that_only_listens(bench):
    port = free_udp_port()
    bench.run(AutopilotSimNode, port=0, ground_station=f'udpout:127.0.0.1:{port}')
    link = open_vehicle(f'udpin:127.0.0.1:{port}')
    assert link.telemetry().mode
    link.close()


@pytest.mark.parametrize('given', ['127.0.0.1:14550', 'udpin:127.0.0.1:14550', 'udpout:14550'])
def test_a_ground_station_that_cannot_be_sent_to_is_refused(bench, given):
    with pytest.raises(PeaceError, match='udpout:HOST:PORT'):
        bench.run(AutopilotSimNode, port=0, ground_station=given)


def test_a_twist_vehicle_stops_when_nobody_speaks():
    vehicle = TwistVehicle(altitude_m=50.0, timeout_s=1.0)
    vehicle.advance(0, 0.0)
    vehicle.command(2.0, 1.0, -3.0, 0.0, 0.0)
    pose = vehicle.advance(1_000_000_000, 0.9)
    assert (pose.north_m, pose.east_m, pose.altitude_agl_m) == (2.0, -1.0, 47.0)
    assert vehicle.advance(5_000_000_000, 1.1).altitude_agl_m == 47.0


def test_a_twist_vehicle_turns_left_by_positive_rates():
    vehicle = TwistVehicle(altitude_m=50.0, timeout_s=9.0)
    vehicle.advance(0, 0.0)
    vehicle.command(0.0, 0.0, 0.0, pi / 2, 0.0)
    vehicle.advance(1_000_000_000, 1.0)
    vehicle.command(4.0, 0.0, 0.0, 0.0, 1.0)
    assert vehicle.advance(2_000_000_000, 2.0).east_m == pytest.approx(-4.0)


def test_a_twist_vehicle_refuses_what_is_no_number():
    vehicle = TwistVehicle(altitude_m=50.0, timeout_s=1.0)
    with pytest.raises(VehicleError, match='nan'):
        vehicle.command(float('nan'), 0.0, 0.0, 0.0, 0.0)
