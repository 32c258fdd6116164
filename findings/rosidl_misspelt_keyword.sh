#!/usr/bin/env bash
# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
#
# The constructor of a Python message of ROS 2 Jazzy takes any keyword. A misspelt field is dropped
# without an error, and the field that was meant keeps its zero.
#
# Guess before looking: a TypeError or an AssertionError, as for a misspelt attribute.
# Seen (ros-jazzy-common-interfaces 5.3.6):
#   CameraInfo(width=640, hieght=480)                      height is 0, no error
#   the same with ROS_PYTHON_CHECK_FIELDS=1                AssertionError
#   camera_info.hieght = 480                               AttributeError, in both cases
# A set-point with a misspelt field commands zero in it. Set that variable in tests.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --disable-pip-version-check ros-jazzy-rclpy==7.1.6 \
    ros-jazzy-common-interfaces==5.3.6 ros-jazzy-rmw-fastrtps-cpp numpy==2.4.6
export AMENT_PREFIX_PATH=$folder/venv ROS_LOG_DIR=$folder/log
unset _ROS_WHEELS_BOOTSTRAP_COMPLETE LD_LIBRARY_PATH PYTHONPATH ROS_PYTHON_CHECK_FIELDS
cat > "$folder/keyword.py" <<'PYTHON'
from sensor_msgs.msg import CameraInfo


def tried(make):
    try:
        return f'height {make().height}'
    except (AssertionError, AttributeError, TypeError) as error:
        return type(error).__name__


def assigned():
    message = CameraInfo(width=640)
    message.hieght = 480
    return message


print(tried(lambda: CameraInfo(width=640, hieght=480)), tried(assigned))
PYTHON
plain=$("$folder/venv/bin/python" "$folder/keyword.py")
checked=$(ROS_PYTHON_CHECK_FIELDS=1 "$folder/venv/bin/python" "$folder/keyword.py")
echo "unchecked: $plain"
echo "checked:   $checked"
if [[ $plain != 'height 0 AttributeError' || $checked != 'AssertionError AttributeError' ]]; then
    echo changed
    exit 1
fi
echo 'as stated'
