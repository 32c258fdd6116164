# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What a user may ask of the demo, refused before anything is started when it makes no sense."""

from __future__ import annotations

import socket
from dataclasses import dataclass, replace
from datetime import datetime, timezone
from pathlib import Path
from typing import Annotated

from typer import Option

from peace_ros.core.domain import Camera, ConfigurationError, Distortion, VehicleError
from peace_ros.core.node_parameters import CameraOptions
from peace_ros.core.vehicle.transport import parse_url
from peace_ros.recording.run_folder import create_run_folder

DEFAULT_TIMEOUT_S = 330.0
"""Longer than the landing searches (max_search_s), so that "no safe place" can be its answer."""
_SPEED_LIMITS = (0.1, 10.0)
_SIDE_LIMITS_PX = (64, 4096)
_GSD_LIMITS_M = (0.01, 5.0)
AUTOPILOTS = ('ardupilot', 'px4')
_NETWORK_KINDS = ('udp', 'udpin', 'udpout', 'udpbcast', 'tcp', 'tcpin')


@dataclass(frozen=True)
class DemoOptions:
    """The options of ``peace demo``."""

    world: Annotated[
        Path | None, Option(help='Orthophoto (JPEG, PNG, GeoTIFF); without it a world is drawn.')
    ] = None
    gsd_m: Annotated[
        float | None, Option('--gsd', metavar='M', help='Metres of ground per pixel of --world.')
    ] = None
    labels: Annotated[
        Path | None,
        Option(help='Label raster of --world; <name>_label.png beside it is found without this.'),
    ] = None
    start: Annotated[
        str | None,
        Option(
            metavar='X,Y', help='Start, metres east and north of the centre; default by --seed.'
        ),
    ] = None
    config: Annotated[
        str, Option(metavar='PRESET', help='Preset: dd, d or peace, with _cs or _fs; or a file.')
    ] = 'peace_cs'
    speed: Annotated[
        float | None,
        Option(help='Simulated seconds per second; default: 2 if this machine keeps up.'),
    ] = None
    seed: Annotated[int, Option(help='Seed of the drawn world and of the start.')] = 1
    autopilot: Annotated[
        str | None, Option(metavar='KIND', help='What is simulated: ardupilot (default) or px4.')
    ] = None
    mavlink: Annotated[
        str | None, Option(metavar='URL', help='An autopilot that already runs.')
    ] = None
    pose_mavlink: Annotated[
        str | None,
        Option(metavar='URL', help='A second connection to it, which the camera follows.'),
    ] = None
    camera_size: Annotated[
        str,
        Option(
            '--camera',
            metavar='WxH',
            help='Size of the image; 704x704, 640x480 and more are also seen in parts; takes time.',
        ),
    ] = '352x352'
    fov_deg: Annotated[
        float, Option('--fov', metavar='DEG', help='Full horizontal field of view.')
    ] = CameraOptions().camera_fov
    distortion: Annotated[
        str | None,
        Option(
            metavar='[MODEL:]K1,K2,...',
            help='Of the lens, as in CameraInfo: plumb_bob, rational_polynomial or equidistant.',
        ),
    ] = None
    mount_pitch_deg: Annotated[
        float, Option('--mount-pitch', metavar='DEG', help='The camera looks so far ahead.')
    ] = 0.0
    mount_yaw_deg: Annotated[
        float,
        Option('--mount-yaw', metavar='DEG', help='The top of the image is so far to the right.'),
    ] = 0.0
    run_dir: Annotated[
        Path | None,
        Option(metavar='DIR', help='Empty or new folder; default runs/<time>-seed<seed>.'),
    ] = None
    timeout_s: Annotated[
        float, Option('--timeout', metavar='S', help='Seconds that the landing may take.')
    ] = DEFAULT_TIMEOUT_S
    """Wall clock, from the engagement."""
    watch: Annotated[
        bool, Option('--watch', help='Show the flight on a live page (peace watch) too.')
    ] = False

    def __post_init__(self) -> None:
        self._check_world()
        _ = self.start_m
        self._check_vehicle()
        if self.speed is not None and not _SPEED_LIMITS[0] <= self.speed <= _SPEED_LIMITS[1]:
            raise ConfigurationError(
                f'--speed {self.speed}: give {_SPEED_LIMITS[0]} to {_SPEED_LIMITS[1]}'
            )
        if not 10.0 <= self.timeout_s <= 7200.0:
            raise ConfigurationError(f'--timeout {self.timeout_s} s: give 10 to 7200')
        _ = self.camera
        if not 0 <= self.seed < 2**31:
            raise ConfigurationError(f'--seed {self.seed}: give 0 to {2**31 - 1}')

    @property
    def start_m(self) -> tuple[float, float] | None:
        """Local origin of the vehicle, metres east and north of the centre of the world."""
        return None if self.start is None else parse_start(self.start)

    def _check_world(self) -> None:
        if self.world is None:
            for name, value in (('--gsd', self.gsd_m), ('--labels', self.labels)):
                if value is not None:
                    raise ConfigurationError(f'{name} {value} belongs to --world FILE: give both')
            return
        if not self.world.is_file():
            raise ConfigurationError(f'--world {self.world}: no such file; give an orthophoto')
        if self.gsd_m is None:
            raise ConfigurationError(
                f'--world {self.world} needs --gsd M: metres of ground per pixel'
            )
        if not _GSD_LIMITS_M[0] <= self.gsd_m <= _GSD_LIMITS_M[1]:
            raise ConfigurationError(
                f'--gsd {self.gsd_m} m: give {_GSD_LIMITS_M[0]} to {_GSD_LIMITS_M[1]} metres of '
                'ground per pixel'
            )
        if self.labels is not None and not self.labels.is_file():
            raise ConfigurationError(f'--labels {self.labels}: no such file; give a label raster')

    def _check_vehicle(self) -> None:
        if self.autopilot not in {None, *AUTOPILOTS}:
            raise ConfigurationError(
                f'--autopilot {self.autopilot!r}: choose one of {", ".join(AUTOPILOTS)}'
            )
        if self.autopilot is not None and self.mavlink is not None:
            raise ConfigurationError(
                f'--autopilot {self.autopilot} with --mavlink: what is connected says itself what '
                'it is; leave --autopilot out'
            )
        if (self.mavlink is None) != (self.pose_mavlink is None):
            raise ConfigurationError(
                '--mavlink and --pose-mavlink belong together: the landing node commands over the '
                'first while the camera follows the pose on the second'
            )
        for name, url in (('--mavlink', self.mavlink), ('--pose-mavlink', self.pose_mavlink)):
            if url is not None:
                _check_url(name, url)
        if self.mavlink == self.pose_mavlink and not (self.mavlink or 'udpout:').startswith(
            'udpout:'
        ):
            raise ConfigurationError(
                f'--pose-mavlink {self.pose_mavlink} is the URL of --mavlink: give a second '
                'connection'
            )
        if self.mavlink is not None and self.speed not in {None, 1.0}:
            raise ConfigurationError(
                f'--speed {self.speed} with --mavlink: the clock of a given autopilot cannot be '
                'changed; leave --speed out'
            )

    @property
    def camera_options(self) -> CameraOptions:
        """Size, field of view and mount of the camera."""
        width, height = parse_size(self.camera_size)
        return CameraOptions(
            camera_width=width,
            camera_height=height,
            camera_fov=self.fov_deg,
            mount_pitch=self.mount_pitch_deg,
            mount_yaw=self.mount_yaw_deg,
        )

    @property
    def lens(self) -> Distortion | None:
        """The distortion of the camera, None without any."""
        return None if self.distortion is None else parse_distortion(self.distortion)

    @property
    def camera(self) -> Camera:
        """The camera with its lens."""
        return replace(self.camera_options.camera, distortion=self.lens)

    @property
    def own_autopilot(self) -> bool:
        """The demo brings its own simulated autopilot."""
        return self.mavlink is None

    def label_file(self) -> Path | None:
        """Return the label raster given, or the one that lies beside the world."""
        if self.labels is not None or self.world is None:
            return self.labels
        beside = self.world.with_name(f'{self.world.stem}_label.png')
        return beside if beside.is_file() else None

    def new_run_dir(self) -> Path:
        """Return the run folder, created.

        Raises:
            ConfigurationError: it holds something already or cannot be created.
        """
        now = datetime.now(timezone.utc).strftime('%Y%m%d-%H%M%S')
        return create_run_folder(self.run_dir, f'{now}-seed{self.seed}', '--run-dir')


def parse_start(text: str) -> tuple[float, float]:
    """Read ``X,Y``: metres east and north of the centre of the world.

    Raises:
        ConfigurationError: anything else.
    """
    parts = text.split(',')
    try:
        east, north = (float(each) for each in parts)
    except ValueError as error:
        raise ConfigurationError(
            f'--start {text!r}: give X,Y in metres east and north of the centre, e.g. 40,-25'
        ) from error
    if not (abs(east) <= 1e5 and abs(north) <= 1e5):
        raise ConfigurationError(f'--start {text!r}: give at most 100000 m from the centre')
    return east, north


def parse_size(text: str) -> tuple[int, int]:
    """Read ``WxH``: pixels of an image.

    Raises:
        ConfigurationError: anything else, or a size that no camera of the demo has.
    """
    width, cross, height = text.partition('x')
    if not cross or not (width + height).isascii() or not (width.isdigit() and height.isdigit()):
        raise ConfigurationError(f'--camera {text!r}: give WxH in pixels, e.g. 640x360')
    size = int(width), int(height)
    if not all(_SIDE_LIMITS_PX[0] <= each <= _SIDE_LIMITS_PX[1] for each in size):
        raise ConfigurationError(
            f'--camera {text}: give {_SIDE_LIMITS_PX[0]} to {_SIDE_LIMITS_PX[1]} pixels a side'
        )
    return size


def parse_distortion(text: str) -> Distortion:
    """Read ``[MODEL:]K1,K2,...``; without a model it is plumb_bob.

    Raises:
        ConfigurationError: anything else.
    """
    model, colon, numbers = text.rpartition(':')
    try:
        coefficients = tuple(float(each) for each in numbers.split(','))
    except ValueError as error:
        raise ConfigurationError(
            f'--distortion {text!r}: give numbers with commas between them, e.g. -0.2,0.04,0,0'
        ) from error
    return Distortion(model if colon else 'plumb_bob', coefficients)


def _check_url(option: str, url: str) -> None:
    try:
        parse_url(url)
    except VehicleError as error:
        raise ConfigurationError(f'{option}: {error}') from error


def is_on_this_machine(url: str) -> bool:
    """Tell whether a MAVLink URL can only mean a peer on this machine.

    A port that is open to the network (``udpin:0.0.0.0:14550``) may bring a real vehicle, and so
    may a serial line; both are not of this machine.
    """
    kind, _, rest = url.partition(':')
    if kind not in _NETWORK_KINDS:
        return False
    host = rest.lstrip('/').rsplit(':', 1)[0].strip('[]')
    try:
        found = socket.getaddrinfo(host, None)
    except OSError:
        return False
    addresses = {str(entry[4][0]) for entry in found}
    return bool(addresses) and all(
        address == '::1' or address.startswith('127.') for address in addresses
    )


def refuse_to_arm_elsewhere(url: str) -> None:
    """Refuse to arm a vehicle that may be real.

    Raises:
        VehicleError: the URL does not stay on this machine.
    """
    if not is_on_this_machine(url):
        raise VehicleError(
            f'the vehicle at {url} is on the ground and not on this machine: a demo arms and takes '
            'off only over 127.0.0.1; fly it to about 100 m yourself and start the demo again'
        )
