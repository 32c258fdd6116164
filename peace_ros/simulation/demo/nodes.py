# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The command lines of the six nodes."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path

from peace_ros.core.domain import Distortion
from peace_ros.core.node_parameters import CameraOptions
from peace_ros.simulation.demo.worlds import DemoWorld

CAMERA_HZ = 10.0
"""Frames per second of the wall clock; more would only be dropped by two cores."""

Arguments = dict[str, list[str]]

MODULES = {
    'prompt_generator': 'peace_ros.nodes.prompt_generator',
    'segmentation': 'peace_ros.nodes.segmentation',
    'landing': 'peace_ros.nodes.landing',
    'recorder': 'peace_ros.recorder.recorder',
    'satellite_view': 'peace_ros.simulation.nodes.satellite_view',
    'autopilot_sim': 'peace_ros.simulation.nodes.autopilot_sim',
}
"""Node -> the module that runs it."""


@dataclass(frozen=True)
class Wiring:
    """How the nodes of one run are connected."""

    world: DemoWorld
    camera: CameraOptions
    lens: Distortion | None
    """None: without distortion."""
    preset: Path
    recordings: Path
    """Folder of the flight recorder."""
    speed: float
    mavlink: str
    """URL for the landing node."""
    pose_mavlink: str | None
    """URL for the camera; None: it follows ``ground_truth/pose`` of our own autopilot."""
    autopilot_port: int | None
    """UDP port of our own autopilot; None: it is not started."""
    autopilot: str = 'ardupilot'
    """Which one our own plays."""

    @property
    def use_sim_time(self) -> bool:
        """The nodes take their time from ``/clock`` of our own autopilot."""
        return self.autopilot_port is not None and self.speed != 1.0


def node_arguments(wiring: Wiring) -> Arguments:
    """Return module name -> command line arguments, in the order in which to start them."""
    clock = {'use_sim_time': wiring.use_sim_time}
    arguments: Arguments = {}
    if wiring.autopilot_port is not None:
        autopilot = {
            'autopilot': wiring.autopilot,
            'port': wiring.autopilot_port,
            'ground_station': '',
            'speed': float(wiring.speed),
            'publish_clock': wiring.use_sim_time,
        }
        arguments['autopilot_sim'] = ros_arguments(autopilot)
    camera = asdict(wiring.camera)
    arguments['satellite_view'] = ros_arguments({**clock, **camera, **_view(wiring)})
    arguments['prompt_generator'] = ros_arguments(clock, wiring.preset)
    arguments['segmentation'] = ros_arguments(clock, wiring.preset)
    # What took the frames comes with them; only the mount is not in camera_info.
    mount = {name: value for name, value in camera.items() if name.startswith('mount_')}
    arguments['recorder'] = ros_arguments({**clock, 'recordings': str(wiring.recordings)})
    arguments['landing'] = ros_arguments(
        {**clock, **mount, 'mavlink': wiring.mavlink}, wiring.preset
    )
    return arguments


def _view(wiring: Wiring) -> dict[str, object]:
    world = wiring.world
    view: dict[str, object] = {
        'world': str(world.image_file),
        'gsd': float(world.world.gsd_m),
        'labels': '' if world.label_file is None else str(world.label_file),
        'start_x': float(world.start_east_m),
        'start_y': float(world.start_north_m),
        'rate': CAMERA_HZ / wiring.speed,
    }
    if wiring.lens is not None:
        view.update(distortion_model=wiring.lens.model, distortion=list(wiring.lens.coefficients))
    if wiring.pose_mavlink is not None:
        view.update(pose_source='mavlink', pose_mavlink=wiring.pose_mavlink)
    return view


def ros_arguments(
    parameters: Mapping[str, object],
    preset: Path | None = None,
    remaps: Mapping[str, str] | None = None,
) -> list[str]:
    """Return the command line of a node: parameters, parameter file, topic -> other topic."""
    given = ['--ros-args']
    if preset is not None:
        given += ['--params-file', str(preset)]
    for name, value in parameters.items():
        given += ['-p', f'{name}:={_yaml(value)}']
    for name, topic in (remaps or {}).items():
        given += ['-r', f'{name}:={topic}']
    return given


def _yaml(value: object) -> str:
    """Write a value so that ROS reads back the same type."""
    if isinstance(value, bool):
        return 'true' if value else 'false'
    if isinstance(value, str):
        return "'" + value.replace("'", "''") + "'"
    return repr(value)
