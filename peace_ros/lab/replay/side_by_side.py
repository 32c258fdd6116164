# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What other parameters or models do on one recording: two replays on one page.

Needs jinja2 (the extra ``lab``); the page itself is ``templates/side_by_side.html.j2``.
"""

from __future__ import annotations

import base64
from dataclasses import dataclass, replace
from importlib.resources import files
from io import StringIO
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from peace_ros import __version__
from peace_ros.core.domain import ConfigurationError
from peace_ros.lab.chart_style import CHART_STYLE
from peace_ros.lab.replay.golden import compare
from peace_ros.lab.replay.moments import moment_sheets
from peace_ros.lab.replay.report import ReplayReport
from peace_ros.lab.replay.run import Progress, ReplayOptions, replay
from peace_ros.lab.replay.trace import Trace, TraceBuilder, described
from peace_ros.recording.run_folder import create_run_folder, write_whole

try:
    from jinja2 import Environment, StrictUndefined
except ImportError as error:
    raise ConfigurationError(f'the page needs {error.name}: run pip install jinja2') from error

PAGE = 'side_by_side.html'
COLOURS = ('#0b62a8', '#c2410c')
_MOST_MOMENTS = 4
_APART_S = 2.0
"""Moments that are shown are at least so far apart."""


@dataclass(frozen=True)
class Side:
    """One of the two replays."""

    name: str
    report: ReplayReport
    trace: Trace


def replay_side_by_side(
    options: ReplayOptions, presets: tuple[str, str], progress: Progress | None = None
) -> tuple[list[Side], Path]:
    """Replay a recording with two presets; return both replays and the page.

    Args:
        options: of both; their assignments count for the second preset alone.
        presets: names or parameter files.
        progress: is told of both replays, one after the other.

    Raises:
        PeaceError: as :func:`peace_ros.lab.replay.replay`.
    """
    both = (
        replace(options, config=presets[0], assignments=()),
        replace(options, config=presets[1]),
    )
    names = [each.preset.name for each in both]  # refused before the minutes of the first replay
    folder = create_run_folder(options.out, f'{options.source.resolve().stem}_compared', '--out')
    sides = []
    for letter, name, each in zip('AB', names, both, strict=True):
        builder = TraceBuilder()
        report, _ = replay(replace(each, out=folder / letter), progress, builder)
        sides.append(Side(f'{letter}: {name}', report, builder.trace(each.preset, report)))
    page = folder / PAGE
    write_whole(page, _page(options, sides), 'page')
    return sides, page


def figures(sides: list[Side]) -> list[tuple[str, list[str]]]:
    """Return the rows of the table: heading, and a cell for each replay."""

    def row(heading: str, cell: Any) -> tuple[str, list[str]]:
        return heading, [cell(each.report) for each in sides]

    return [
        row('frames with a heatmap', lambda r: str(r.frames)),
        row('heatmaps', lambda r: ', '.join(f'{n} {fate}' for fate, n in r.heatmaps.items())),
        row('called safe', lambda r: f'{100.0 * r.mean_safe_fraction:.1f} %'),
        row(
            'states',
            lambda r: ', '.join(f'{each["name"]} {each["seconds"]:.1f} s' for each in r.states),
        ),
        row('verdicts', lambda r: ', '.join(f'{k} {n}' for k, n in r.verdicts.items())),
        row('outcome', lambda r: r.outcome or 'none by the end'),
        row('prompts', lambda r: '; '.join(r.prompts)),
        row('compute time', lambda r: f'{r.elapsed_s:.1f} s'),
    ]


def _page(options: ReplayOptions, sides: list[Side]) -> str:
    first, second = (each.trace for each in sides)
    template = files(__package__) / 'templates' / f'{PAGE}.j2'
    environment = Environment(
        autoescape=True, trim_blocks=True, lstrip_blocks=True, undefined=StrictUndefined
    )
    traces = {each.name: each.trace for each in sides}
    sheets = moment_sheets(options, traces, moments_apart(first, second), 'largest difference')
    return environment.from_string(template.read_text('utf-8')).render(
        title=options.source.name,
        version=__version__,
        names=[each.name for each in sides],
        made_with=[described(each.trace.made_with) for each in sides],
        rows=figures(sides),
        checks=compare(second, first),
        chart=_chart(sides),
        pictures=[_embedded(each) for each in sheets],
    )


def moments_apart(first: Trace, second: Trace) -> list[int]:
    """Return the stamps at which two replays of a recording differ most by what they call safe."""
    stamps, mine, theirs = np.intersect1d(
        first.frame_stamps_ns, second.frame_stamps_ns, assume_unique=True, return_indices=True
    )
    if first.mask_shape != second.mask_shape:
        return [int(each) for each in stamps[:: max(1, len(stamps) // _MOST_MOMENTS)]][
            :_MOST_MOMENTS
        ]
    other = np.array(
        [
            np.count_nonzero(first.safe(a) ^ second.safe(b))
            for a, b in zip(mine, theirs, strict=True)
        ]
    )
    chosen: list[int] = []
    for index in np.argsort(-other, kind='stable'):
        stamp = int(stamps[index])
        if all(abs(stamp - each) >= _APART_S * 1e9 for each in chosen):
            chosen.append(stamp)
        if len(chosen) == _MOST_MOMENTS:
            break
    return chosen


def _chart(sides: list[Side]) -> str:
    """Return an ``svg`` element: states, safe share and set-points over the time."""
    begin_ns = min(int(each.trace.step_stamps_ns[0]) for each in sides)
    names = list(dict.fromkeys(name for each in sides for name in each.trace.distinct_states))
    with rc_context(CHART_STYLE):
        figure = Figure((9.0, 7.0), layout='constrained')
        axes: list[Axes] = list(figure.subplots(4, 1, sharex=True))
        for colour, style, each in zip(COLOURS, ('-', '--'), sides, strict=True):
            trace = each.trace
            steps_s = (trace.step_stamps_ns - begin_ns) * 1e-9
            frames_s = (trace.frame_stamps_ns - begin_ns) * 1e-9
            look: dict[str, Any] = {'color': colour, 'linestyle': style, 'label': each.name}
            states = [names.index(name) for name in trace.states]
            axes[0].step(steps_s, states, where='post', **look)
            safe = [100.0 * float(trace.safe(k).mean()) for k in range(len(trace.masks))]
            axes[1].plot(frames_s, safe, **look)
            speed = np.hypot(trace.setpoints_m_s[:, 0], trace.setpoints_m_s[:, 1])
            axes[2].plot(steps_s, speed, **look)
            axes[3].plot(steps_s, trace.setpoints_m_s[:, 2], **look)
        axes[0].set_yticks(range(len(names)), names)
        for place, title in enumerate(
            ('state', 'called safe, % of the frame', 'set-point over ground, m/s', 'down, m/s')
        ):
            axes[place].set_title(title)
        axes[0].legend(loc='upper right', fontsize='small')
        axes[-1].set_xlabel('seconds')
        text = StringIO()
        figure.savefig(text, format='svg', metadata={'Date': None})
    drawn = text.getvalue()
    return drawn[drawn.index('<svg') :]


def _embedded(sheet: Any) -> str:
    _, data = cv2.imencode('.jpg', cv2.cvtColor(sheet, cv2.COLOR_RGB2BGR))
    return base64.b64encode(data.tobytes()).decode()
