#!/usr/bin/env bash
# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
#
# AnyReader.messages(connections=...) is the way to read some topics of a bag. Whoever selects the
# connections by name and finds none asks for nothing, and gets every message of every topic.
#
# Guess before looking: an empty list gives no message.
# Seen (rosbags 0.11.9), a bag with 3 messages on /a and 2 on /b:
#   connections of /a      3 messages
#   connections of /c, []  5 messages, of /a and /b
# A misspelt topic is then replayed as whatever else the bag holds. Check that the list is not empty.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --disable-pip-version-check rosbags==0.11.9
"$folder/venv/bin/python" - "$folder/bag" <<'PYTHON'
import sys
from pathlib import Path

from rosbags.highlevel import AnyReader
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

path = Path(sys.argv[1])
store = get_typestore(Stores.ROS2_JAZZY)
kind = 'std_msgs/msg/String'
with Writer(path, version=9, storage_plugin=StoragePlugin.MCAP) as bag:
    for topic, count in (('/a', 3), ('/b', 2)):
        connection = bag.add_connection(topic, kind, typestore=store)
        for stamp in range(count):
            bag.write(connection, stamp, store.serialize_cdr(store.types[kind](topic), kind))

read = {}
with AnyReader([path], default_typestore=store) as bag:
    for topic in ('/a', '/c'):
        wanted = [each for each in bag.connections if each.topic == topic]
        read[topic] = [each.topic for each, _, _ in bag.messages(connections=wanted)]
        print(f'asked for {topic}, {len(wanted)} connections: {len(read[topic])} messages', *read[topic])
if read['/a'] != ['/a'] * 3 or sorted(read['/c']) != ['/a'] * 3 + ['/b'] * 2:
    raise SystemExit('changed')
print('as stated')
PYTHON
