#!/usr/bin/env bash
# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
#
# Two nodes may have one name; rcl warns of it. Asked for the topics of a node of that name, rclpy
# tells those of one of the two only, also to the other one, which then does not find what it has
# just created. All topics are in the list of topics, and both nodes in the list of nodes.
#
# Guess before looking: the topics of both together, since nothing else tells the nodes apart.
# Seen (ros-jazzy-rclpy 7.1.6, ros-jazzy-rmw-fastrtps-cpp 8.4.3), nodes "landing" with a publisher of
# "first" and of "second", and a third node that asks, each in a participant of its own:
#   all three are told /first and nothing else, the node that publishes /second too
# Whoever counts the publishers of a topic is right; whoever asks what a node publishes may be wrong.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --disable-pip-version-check ros-jazzy-rclpy==7.1.6 \
    ros-jazzy-common-interfaces==5.3.6 ros-jazzy-rmw-fastrtps-cpp==8.4.3 numpy==2.4.6
export AMENT_PREFIX_PATH=$folder/venv ROS_LOG_DIR=$folder/log
export ROS_AUTOMATIC_DISCOVERY_RANGE=LOCALHOST ROS_DOMAIN_ID=97
unset _ROS_WHEELS_BOOTSTRAP_COMPLETE LD_LIBRARY_PATH PYTHONPATH
"$folder/venv/bin/python" - <<'PYTHON'
import time

import rclpy
from rclpy.node import Node
from std_msgs.msg import Empty

OURS = {'/first', '/second'}


def node(name, topic=None):
    """Return a node in a participant of its own, with a publisher of a topic."""
    context = rclpy.Context()
    rclpy.init(context=context)
    made = Node(name, context=context)
    if topic is not None:
        made.create_publisher(Empty, topic, 1)
    return made


def told(asking):
    pairs = asking.get_publisher_names_and_types_by_node('landing', '/')
    return sorted(OURS & {topic for topic, _ in pairs})


first, second, asking = node('landing', 'first'), node('landing', 'second'), node('asking')
deadline = time.monotonic() + 20.0
while time.monotonic() < deadline:
    topics = OURS & {topic for topic, _ in asking.get_topic_names_and_types()}
    nodes = asking.get_node_names().count('landing')
    if topics == OURS and nodes == 2:
        break
    time.sleep(0.2)
time.sleep(2.0)
answers = [told(each) for each in (first, second, asking)]
print(f'{nodes} nodes, topics {sorted(topics)}; each of three is told {answers}')
if nodes != 2 or topics != OURS or answers != 3 * [['/first']]:
    raise SystemExit('changed')
print('as stated')
PYTHON
