# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""All checks, side by side where they only wait, within ten seconds."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any

from peace_ros.core.node_parameters import CameraOptions, LandingOptions
from peace_ros.core.presets import Preset
from peace_ros.core.vehicle import VehicleParameters
from peace_ros.lab.doctor.autopilot import check_autopilot
from peace_ros.lab.doctor.finding import CheckResult, Finding, Findings, mend, not_checked
from peace_ros.lab.doctor.machine import check_machine
from peace_ros.lab.doctor.middleware import check_middleware, check_shared_memory
from peace_ros.lab.doctor.models import Models

BYTES_PER_PIXEL = 3
Remedy = Callable[[ModuleNotFoundError], str | None]
"""Says how to install a package that is missing; None for what no command mends."""


@dataclass(frozen=True)
class DoctorOptions:
    """What to check."""

    preset: Preset
    mavlink: str = ''
    """URL of the autopilot; empty: it is not checked."""
    image: str = ''
    """Topic of the camera; empty: the only one that there is."""


def examine(options: DoctorOptions, remedy: Remedy) -> dict[str, list[Finding]]:
    """Return subject -> findings, in the order of the report.

    Args:
        options: What to check.
        remedy: Says how to install a package that is missing.

    Raises:
        ConfigurationError: A value of the preset cannot be used.
    """
    vehicle = options.preset.fill('landing', VehicleParameters)
    landing = options.preset.fill('landing', LandingOptions)
    camera = options.preset.fill('landing', CameraOptions)
    models = Models(options.preset)
    with ThreadPoolExecutor(2) as pool:
        middleware_and_camera = pool.submit(_ros, options.image, camera, remedy)
        autopilot = pool.submit(lambda: list(_autopilot(options.mavlink, vehicle, landing.dialect)))
        of_models = list(models.load())
        found = {'ROS and DDS': [], 'Camera': [], **middleware_and_camera.result()}
        found['Autopilot'] = autopilot.result()
    # Timed alone: while others listen, a frame would take longer than in flight.
    width_px, height_px = _size(found['Camera'], camera)
    of_models += models.time_frame(width_px, height_px)
    return {**found, 'Models': of_models, 'Computer': list(check_machine())}


def _ros(topic: str, camera: CameraOptions, remedy: Remedy) -> dict[str, list[Finding]]:
    try:
        ros = list(check_middleware())
        if not any('rmw' in each.figures for each in ros):
            return {'ROS and DDS': ros}
        of_camera = list(_camera(topic, camera))
        width_px, height_px = _size(of_camera, camera)
        ros += check_shared_memory(ros[0].figures['rmw'], width_px * height_px * BYTES_PER_PIXEL)
    except ModuleNotFoundError as error:
        sentence = remedy(error)
        if sentence is None:
            raise
        missing, _, command = sentence.partition(': ')
        return {'ROS and DDS': [mend(missing, command)]}
    return {'ROS and DDS': ros, 'Camera': of_camera}


def _camera(topic: str, options: CameraOptions) -> Findings:
    # ROS may be missing.
    from peace_ros.lab.doctor.camera import (  # noqa: PLC0415
        CameraListener,
        find_camera,
        judge_camera,
    )

    listener = CameraListener()
    try:
        heard = find_camera(listener, topic)
    finally:
        listener.close()
    if isinstance(heard, Finding):
        yield heard
    else:
        yield from judge_camera(heard, options)


def _autopilot(url: str, vehicle: VehicleParameters, dialect: str) -> Findings:
    if url:
        return check_autopilot(url, vehicle, dialect)
    return iter((not_checked('MAVLink connection', 'give --mavlink URL'),))


def _size(findings: list[Finding], options: CameraOptions) -> tuple[int, int]:
    """Return width and height of the camera's images in pixels; unseen, as the parameters say."""
    for each in findings:
        if 'width_px' in each.figures:
            return int(each.figures['width_px']), int(each.figures['height_px'])
    return options.camera_width, options.camera_height


def as_json(found: Mapping[str, list[Finding]], seconds: float) -> dict[str, Any]:
    """Return the report for programs.

    Args:
        found: Subject -> findings.
        seconds: That the checks took.
    """
    return {
        'passed': not needs_mending(found),
        'seconds': round(seconds, 2),
        'findings': [
            {
                'subject': subject,
                'outcome': each.outcome.value,
                'found': each.found,
                'remedy': each.remedy,
                'figures': dict(each.figures),
            }
            for subject, findings in found.items()
            for each in findings
        ],
    }


def needs_mending(found: Mapping[str, list[Finding]]) -> int:
    """Return how many findings must be mended before a flight."""
    return sum(each.outcome is CheckResult.MEND for findings in found.values() for each in findings)
