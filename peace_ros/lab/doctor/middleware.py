# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""ROS and DDS: what is installed, who can take part, and whether images fit shared memory."""

from __future__ import annotations

import os
import shutil
from contextlib import suppress
from importlib import metadata
from pathlib import Path
from xml.etree import ElementTree as ET

from peace_ros.core.resources import config_dir
from peace_ros.lab.doctor.finding import Findings, fine, mend, not_checked

RANGE = 'ROS_AUTOMATIC_DISCOVERY_RANGE'
PROFILES = ('FASTRTPS_DEFAULT_PROFILES_FILE', 'FASTDDS_DEFAULT_PROFILES_FILE')
"""Variables of Fast DDS 2 and 3 that name its XML profiles."""
DEFAULT_SEGMENT_BYTES = 549_000
"""Of Fast DDS without profiles; 352 x 352 rgb8 (372 kB) loses nothing, 640 x 480 does."""
FRAMES_IN_SEGMENT = 4
"""Measured: 4 MB is enough for 640 x 480 (0.9 MB), 32 MB for 1920 x 1080 (6.2 MB), at 30 Hz."""
_SHARED_MEMORY = Path('/dev/shm')  # noqa: S108 - it is where DDS puts its segments


def check_middleware() -> Findings:
    """Yield what is installed and who can take part; ModuleNotFoundError without ROS."""
    from rclpy.utilities import get_rmw_implementation_identifier  # noqa: PLC0415 - may be missing

    try:
        rmw = get_rmw_implementation_identifier()
    except RuntimeError as error:
        yield mend(
            f'the middleware cannot be loaded: {str(error).splitlines()[0]}',
            'install the package that RMW_IMPLEMENTATION names, or unset it',
        )
        return
    domain = os.environ.get('ROS_DOMAIN_ID', '0')
    yield fine(f'rclpy {_version()} on {rmw}, domain {domain}', rmw=rmw, domain=domain)
    yield from check_discovery(os.environ.get(RANGE, ''))


def check_discovery(discovery: str) -> Findings:
    """Yield who can engage: everybody who is discovered.

    Args:
        discovery: Value of ROS_AUTOMATIC_DISCOVERY_RANGE; empty: not set, which means SUBNET.
    """
    if not discovery:
        yield mend(
            f'{RANGE} is not set: everybody on the network can engage the landing',
            f'export {RANGE}=LOCALHOST (or SUBNET, when other computers shall take part)',
        )
    elif discovery in {'LOCALHOST', 'OFF'}:
        yield fine(f'discovery range {discovery}: no other computer takes part')
    else:
        yield fine(f'discovery range {discovery}: other computers can engage the landing')


def check_shared_memory(rmw: str, frame_bytes: int) -> Findings:
    """Yield whether camera images fit the shared memory of the middleware.

    Args:
        rmw: Name of the middleware.
        frame_bytes: Of one raw image.
    """
    if 'fastrtps' not in rmw:
        yield not_checked(
            f'shared memory of {rmw}', 'compare the rate in this report with that of the camera'
        )
        return
    file = next((os.environ[each] for each in PROFILES if os.environ.get(each)), '')
    size_mb = frame_bytes / 1e6
    try:
        segment_bytes = segment_of(Path(file)) if file else DEFAULT_SEGMENT_BYTES
    except (OSError, ET.ParseError, ValueError) as error:
        yield mend(
            f'{file} cannot be read ({error})',
            f'correct the file, or let {PROFILES[0]} name config/fastdds.xml of this package',
        )
        return
    found = f'images of {size_mb:.2f} MB, shared-memory segment of {segment_bytes / 1e6:.2f} MB'
    figures = {'frame_bytes': frame_bytes, 'segment_bytes': segment_bytes}
    is_enough = segment_bytes >= FRAMES_IN_SEGMENT * frame_bytes or (
        frame_bytes < segment_bytes == DEFAULT_SEGMENT_BYTES
    )
    if not is_enough:
        yield mend(f'{found}: best-effort images will be lost', _larger(frame_bytes), **figures)
        return
    yield fine(found, **figures)
    if _SHARED_MEMORY.is_dir():
        free_bytes = shutil.disk_usage(_SHARED_MEMORY).free
        if free_bytes < 4 * segment_bytes:
            yield mend(
                f'{_SHARED_MEMORY} has {free_bytes / 1e6:.0f} MB free, and the camera and three '
                f'nodes take {segment_bytes / 1e6:.1f} MB each',
                'start the container with a larger --shm-size, or with --ipc=host',
            )


def _larger(frame_bytes: int) -> str:
    """Return how to have a segment for images of this size."""
    shipped = config_dir() / 'fastdds.xml'
    needed_bytes = FRAMES_IN_SEGMENT * frame_bytes
    file = f'{shipped}'
    if segment_of(shipped) < needed_bytes:
        file = f'a copy of {shipped} with segment_size {needed_bytes} or more'
    return (
        f'let {PROFILES[0]} name {file}, for the camera driver and the nodes; or use '
        'image_transport compressed'
    )


def segment_of(profiles: Path) -> int:
    """Return the size of the shared-memory segment that a file of profiles sets, in bytes.

    Raises:
        OSError, ValueError, ET.ParseError: The file cannot be used.
    """
    # The file is chosen by the user of this computer, as Fast DDS itself takes it.
    for element in ET.parse(profiles).iter():  # noqa: S314
        if element.tag.rpartition('}')[2] == 'segment_size':
            return int(element.text or '')
    return DEFAULT_SEGMENT_BYTES


def _version() -> str:
    for package in ('rclpy', 'ros-jazzy-rclpy'):
        with suppress(metadata.PackageNotFoundError):
            return metadata.version(package)
    return 'of unknown version'
