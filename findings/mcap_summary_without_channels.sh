#!/usr/bin/env bash
# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
#
# The format MCAP lets a writer leave channels and statistics out of the summary. Two readers of
# Python then do not find the messages of a whole and valid file: rosbags in silence, mcap with a
# KeyError.
#
# Guess before looking: both read the channels from the chunks, and find all 50 messages.
# Seen (mcap 1.6.0, rosbags 0.11.9), a file written with repeat_channels, repeat_schemas and
# use_statistics off:
#   mcap, NonSeekingReader     50 messages
#   mcap, make_reader          KeyError: 1
#   rosbags, AnyReader         message_count 50, but no connection, so messages() gives 0
# An empty replay is not proof of an empty bag: compare the count with what the connections give.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --disable-pip-version-check mcap==1.6.0 rosbags==0.11.9
"$folder/venv/bin/python" - "$folder/bare.mcap" <<'PYTHON'
import sys
from pathlib import Path

from mcap.reader import NonSeekingReader, make_reader
from mcap.writer import Writer
from rosbags.highlevel import AnyReader
from rosbags.typesys import Stores, get_typestore

path = Path(sys.argv[1])
with path.open('wb') as file:
    writer = Writer(
        file, chunk_size=2000, repeat_channels=False, repeat_schemas=False, use_statistics=False
    )
    writer.start(profile='ros2', library='')
    schema = writer.register_schema('std_msgs/msg/String', 'ros2msg', b'string data')
    channel = writer.register_channel('/words', 'cdr', schema)
    for index in range(50):
        text = b'\x00\x01\x00\x00\x08\x00\x00\x00message\x00'
        writer.add_message(channel, log_time=index, publish_time=index, data=text)
    writer.finish()

with path.open('rb') as file:
    without_index = sum(1 for _ in NonSeekingReader(file).iter_messages())
with path.open('rb') as file:
    try:
        by_index = str(sum(1 for _ in make_reader(file).iter_messages()))
    except KeyError as error:
        by_index = f'KeyError: {error}'
with AnyReader([path], default_typestore=get_typestore(Stores.ROS2_JAZZY)) as reader:
    rosbags = (reader.message_count, len(reader.connections), sum(1 for _ in reader.messages()))
print(f'mcap without the index: {without_index}')
print(f'mcap with the index: {by_index}')
print('rosbags: message_count {}, connections {}, messages {}'.format(*rosbags))
if (without_index, by_index, rosbags) != (50, 'KeyError: 1', (50, 0, 0)):
    raise SystemExit('changed')
print('as stated')
PYTHON
