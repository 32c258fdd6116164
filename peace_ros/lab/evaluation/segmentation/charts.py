# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The curves of the configurations as SVG, drawn by matplotlib; needs the extra ``lab``."""

from __future__ import annotations

from collections.abc import Iterable
from io import StringIO

import numpy as np
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from peace_ros.lab.chart_style import CHART_STYLE
from peace_ros.lab.evaluation.segmentation.figures import Figures

COLOURS = ('#0b62a8', '#c2410c', '#15803d', '#7e22ce', '#a16207', '#0e7490')
"""Of configurations, in their order."""


def charts(named: dict[str, Figures]) -> list[str]:
    """Return three ``svg`` elements: precision over recall, rates over threshold, reliability."""
    with rc_context(CHART_STYLE):
        trade, trade_axes = _axes('Precision over recall of safe ground', 'recall', 'precision')
        over, over_axes = _axes('Recall (line) and false-safe (dashed)', 'threshold', 'rate')
        trust, trust_axes = _axes('Reliability of the heatmap', 'score', 'safe share')
        trust_axes.plot([0, 100], [0, 100], '--', color='#8c959f', linewidth=1)
        for place, each in enumerate(named.values()):
            colour = COLOURS[place % len(COLOURS)]
            curve, used = each['curve'], {**each, 'precision': None}
            if each['false_safe'] is not None:
                used['precision'] = 1.0 - each['false_safe']
            _draw(trade_axes, curve, 'recall', 'precision', colour, used)
            _draw(over_axes, curve, 'threshold', 'recall', colour, used)
            _draw(over_axes, curve, 'threshold', 'false_safe', colour, used, style='--')
            _draw(trust_axes, each['reliability'], 'score', 'safe', colour)
        return [_svg(figure) for figure in (trade, over, trust)]


def _axes(title: str, x_label: str, y_label: str) -> tuple[Figure, Axes]:
    figure = Figure((4.4, 3.6), layout='constrained')
    axes = figure.subplots()
    axes.set(
        title=title, xlabel=f'{x_label}, %', ylabel=f'{y_label}, %', xlim=(0, 101), ylim=(0, 102)
    )
    return figure, axes


def _draw(
    axes: Axes,
    points: Iterable[Figures],
    x: str,
    y: str,
    colour: str,
    used: Figures | None = None,
    *,
    style: str = '-',
) -> None:
    """Plot shares, 0 to 1, in per cent; a point without a value interrupts the line."""
    line = np.array([(each[x], each[y]) for each in points], float) * 100.0
    axes.plot(*line.T, style, color=colour)
    if used is not None:
        mark = np.array([[used[x]], [used[y]]], float) * 100.0
        axes.plot(*mark, 'o', color=colour, markeredgecolor='white', clip_on=False)


def _svg(figure: Figure) -> str:
    out = StringIO()
    figure.savefig(out, format='svg', metadata={'Date': None, 'Creator': None})
    return out.getvalue()[out.getvalue().index('<svg') :]
