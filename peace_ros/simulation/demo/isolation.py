# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A ROS domain and ports of its own, so that a demo hears and moves nothing but itself."""

from __future__ import annotations

import os
import random
import socket
from pathlib import Path

from peace_ros.core.domain import ConfigurationError
from peace_ros.core.resources import config_dir

PROFILE = 'FASTRTPS_DEFAULT_PROFILES_FILE'
_DOMAINS = range(60, 101)
"""Above 101 the ports of a domain overlap with the ephemeral ports of Linux."""


def isolate(log_dir: Path) -> int:
    """Set the ROS environment of this process and its children; return the domain.

    Call it before ``rclpy.init``. A domain that the user has set is that of their robots and is
    left alone. So is a middleware profile of theirs; without one the shared memory is made large
    enough for pictures, or a reader that died with one in its hands would stop those of others.

    Args:
        log_dir: where ROS keeps its own logs; by default it would be the home directory.

    Raises:
        ConfigurationError: every domain that a demo may take is in use.
    """
    domain = _free_domain()
    os.environ['ROS_DOMAIN_ID'] = str(domain)
    os.environ['ROS_LOG_DIR'] = str(log_dir)
    os.environ['ROS_AUTOMATIC_DISCOVERY_RANGE'] = 'LOCALHOST'
    os.environ.pop('ROS_STATIC_PEERS', None)
    os.environ.setdefault(PROFILE, str(config_dir() / 'fastdds.xml'))
    return domain


def _free_domain() -> int:
    candidates = list(_DOMAINS)
    random.shuffle(candidates)
    for domain in candidates:
        # RTPS 2.5, 9.6.2.3: unicast discovery of the first participant of a domain.
        if _is_free(7400 + 250 * domain + 10):
            return domain
    raise ConfigurationError(
        f'ROS domains {_DOMAINS[0]} to {_DOMAINS[-1]} are all in use on this machine: end other '
        'demos first'
    )


def _is_free(port: int) -> bool:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        try:
            probe.bind(('', port))
        except OSError:
            return False
    return True


def free_udp_port() -> int:
    """Return a UDP port of the loopback interface that is free."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(('127.0.0.1', 0))
        return int(probe.getsockname()[1])
