# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The run folder's pictures and the table at the end."""

from __future__ import annotations

from collections import Counter
from math import isfinite
from pathlib import Path

from rich.table import Table
from rich.text import Text

from peace_ros.core.domain import Pose
from peace_ros.core.domain.geometry import camera_pose, footprint_m, ground_to_camera
from peace_ros.core.optics import pixels
from peace_ros.recording import (
    FilmMoment,
    SiteMark,
    TrackPoint,
    TrajectoryScene,
    draw_filmstrip,
    draw_trajectory,
    save_picture,
)
from peace_ros.simulation.camera import NadirCamera
from peace_ros.simulation.demo.history import History, StateSpan
from peace_ros.simulation.demo.summary import Summary, Truth

_MOST_MOMENTS = 18
_MOST_VISITS = 10
_LEAST_STEP_NS = 100_000_000
"""Poses nearer to each other than this are not drawn."""
_WHOLE_IMAGE = 0.75
"""A focus of at least this part of the image's width is the whole image, and not drawn."""


def draw_pictures(history: History, summary: Summary, truth: Truth, run_dir: Path) -> list[Path]:
    """Write ``trajectory.png`` and ``filmstrip.png``, as far as there is something to show.

    Raises:
        RecordingError: the run folder cannot be written to.
    """
    written = []
    if history.poses:
        picture = draw_trajectory(_scene(history, summary, truth))
        written.append(run_dir / 'trajectory.png')
        save_picture(picture, written[-1])
    moments = _moments(history, truth.camera)
    if moments:
        title = f'{summary.config}, {Path(summary.world).name}'
        written.append(run_dir / 'filmstrip.png')
        save_picture(draw_filmstrip(moments, title), written[-1])
    return written


def headline(summary: Summary) -> Text:
    """Return the result as a coloured sentence."""
    return Text(summary.headline(), style='bold green' if summary.succeeded else 'bold red')


def summary_table(summary: Summary, run_dir: Path) -> Table:
    """Return the table for the end of a demo."""
    table = Table(show_header=False)
    table.add_column(no_wrap=True)
    table.add_column(overflow='fold')
    safe = {True: 'yes', False: 'NO', None: 'not known: the world has no labels there'}
    for name, value in (
        ('outcome', summary.outcome),
        ('safe by ground truth', safe[summary.safe] if summary.outcome == 'handover' else '-'),
        ('altitude', _metres(summary.altitude_agl_m)),
        ('true clearance', _metres(summary.clearance_m)),
        ('time since engaged', f'{summary.duration_s:.1f} s'),
        ('distance over ground', _metres(summary.horizontal_distance_m)),
        ('heatmaps', f'{summary.frames}, {summary.heatmap_hz:.1f} per second'),
        ('states', _states(summary)),
        ('prompts', '\n'.join(each.replace('{term}', '...') for each in summary.prompts) or '-'),
        ('world', summary.world + (', seen beyond its edge (mirrored)' * summary.mirrored)),
        ('config, speed', f'{summary.config}, {summary.speed:g}'),
        ('run folder', str(run_dir)),
    ):
        table.add_row(name, value)
    return table


def _states(summary: Summary) -> str:
    """List the visits of states, or the time in each where they were many."""
    if len(summary.states) <= _MOST_VISITS:
        return ', '.join(f'{each.name} {each.seconds:.1f} s' for each in summary.states) or '-'
    visits = Counter(each.name for each in summary.states)
    told = []
    for name, count in visits.items():
        seconds = sum(each.seconds for each in summary.states if each.name == name)
        told.append(f'{name} {seconds:.1f} s in {count} visits')
    return ', '.join(told)


def _metres(value: float | None) -> str:
    return '-' if value is None else f'{value:.1f} m'


def _scene(history: History, summary: Summary, truth: Truth) -> TrajectoryScene:
    world = truth.camera.world
    track = []
    last_ns: int | None = None
    first_ns = history.poses[0].stamp_ns
    for pose in history.poses:
        if last_ns is None or pose.stamp_ns - last_ns >= _LEAST_STEP_NS:
            last_ns = pose.stamp_ns
            east_m, north_m = truth.in_world(pose)
            time_s = (pose.stamp_ns - first_ns) * 1e-9
            track.append(TrackPoint(time_s, east_m, north_m, pose.altitude_agl_m))
    engaged_s = None
    if history.engaged_ns is not None:
        engaged_s = (history.engaged_ns - first_ns) * 1e-9
    point = summary.hand_over
    return TrajectoryScene(
        world_rgb=world.image_rgb,
        gsd_m=world.gsd_m,
        track=tuple(track),
        engaged_at_s=engaged_s,
        sites=tuple(
            SiteMark(east - world.centre_east_m, north - world.centre_north_m, clearance)
            for north, east, clearance in history.sites[-6:]
        ),
        hand_over=None if point is None else (point['east_m'], point['north_m']),
        hand_over_clearance_m=summary.clearance_m,
        safe=summary.safe,
        title=summary.headline(),
        lines=(
            f'world: {Path(summary.world).name}',
            f'{summary.config}, seed {summary.seed}, speed {summary.speed:g}',
            f'{summary.duration_s:.0f} s since engaged',
            f'{summary.horizontal_distance_m or 0.0:.0f} m over ground',
            f'{summary.frames} heatmaps, {summary.heatmap_hz:.1f} per second',
        ),
    )


def _moments(history: History, eye: NadirCamera) -> list[FilmMoment]:
    spans = history.engaged_spans()
    if len(spans) > _MOST_MOMENTS:
        half = _MOST_MOMENTS // 2
        spans = spans[:half] + spans[-half:]
    since_ns = history.engaged_ns or 0
    return [_moment(span, since_ns, eye) for span in spans]


def _moment(span: StateSpan, since_ns: int, eye: NadirCamera) -> FilmMoment:
    status, pose = span.status, span.pose
    centre, radius, site = None, None, None
    if pose is not None and pose.altitude_agl_m > 1.0:
        focus_m = status.number('focus_radius_m')
        width_m, _ = footprint_m(eye.camera, pose.altitude_agl_m)
        if focus_m is not None and focus_m / width_m < _WHOLE_IMAGE:
            radius = focus_m / width_m
            at = (status.number('focus_north_m'), status.number('focus_east_m'))
            centre = _in_image(eye, pose, at)
        site = _in_image(eye, pose, (status.number('site_north_m'), status.number('site_east_m')))
    return FilmMoment(
        state=span.name,
        time_s=max(0.0, (span.begin_ns - since_ns) * 1e-9),
        altitude_agl_m=pose.altitude_agl_m if pose is not None else None,
        prompt=span.prompt,
        frame_rgb=span.frame_rgb,
        heatmap=span.heatmap,
        focus_centre=centre,
        focus_radius=radius,
        site=site,
    )


def _in_image(
    eye: NadirCamera, pose: Pose, ground: tuple[float | None, float | None]
) -> tuple[float, float] | None:
    """Return where a ground point (north, east) is seen, as fractions of the image."""
    north_m, east_m = ground
    if north_m is None or east_m is None:
        return None
    camera = eye.camera
    direction = ground_to_camera(camera, camera_pose(eye.mount, pose)) @ (north_m, east_m, 1.0)
    if direction[2] <= 0.0:
        return None
    u, v = (float(each[0]) for each in pixels(camera, direction[:, None]))
    return (u / camera.width_px, v / camera.height_px) if isfinite(u + v) else None
