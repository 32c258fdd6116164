# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Line charts over shares, 0 to 1 both ways, as SVG that stands in the page itself."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from html import escape

COLOURS = ('#0b62a8', '#c2410c', '#15803d', '#7e22ce', '#a16207', '#0e7490')
"""Of configurations, in their order."""
_WIDTH, _HEIGHT = 380, 300
_LEFT, _RIGHT, _TOP, _BOTTOM = 48, 14, 30, 42


@dataclass(frozen=True)
class Line:
    """One curve."""

    name: str
    points: Sequence[tuple[float | None, float | None]]
    """(x, y), 0 to 1; a point without a value interrupts the line."""
    colour: str
    mark: tuple[float | None, float | None] | None = None
    """A point to mark: the one in use."""
    dashed: bool = False


def chart(title: str, x_label: str, y_label: str, lines: Sequence[Line]) -> str:
    """Return an ``svg`` element."""
    parts = [
        f'<svg viewBox="0 0 {_WIDTH} {_HEIGHT}" role="img" aria-label="{escape(title)}">',
        f'<text class="title" x="{_LEFT}" y="18">{escape(title)}</text>',
        *_axes(x_label, y_label),
    ]
    for line in lines:
        parts += _drawn(line)
    return '\n'.join([*parts, '</svg>'])


def _x(share: float) -> float:
    return _LEFT + share * (_WIDTH - _LEFT - _RIGHT)


def _y(share: float) -> float:
    return _HEIGHT - _BOTTOM - share * (_HEIGHT - _TOP - _BOTTOM)


def _axes(x_label: str, y_label: str) -> list[str]:
    left, right, bottom, top = _x(0), _x(1), _y(0), _y(1)
    parts = []
    for tick in range(0, 101, 20):
        x, y = _x(tick / 100), _y(tick / 100)
        parts += [
            f'<line class="grid" x1="{left}" x2="{right}" y1="{y:.1f}" y2="{y:.1f}"/>',
            f'<line class="grid" x1="{x:.1f}" x2="{x:.1f}" y1="{bottom}" y2="{top}"/>',
            _text('tick', 'end', f'x="{left - 5}" y="{y + 4:.1f}"', str(tick)),
            _text('tick', 'middle', f'x="{x:.1f}" y="{bottom + 15}"', str(tick)),
        ]
    along = f'transform="translate(12 {(top + bottom) / 2:.1f}) rotate(-90)"'
    return [
        *parts,
        _text('label', 'middle', f'x="{(left + right) / 2:.1f}" y="{_HEIGHT - 8}"', x_label),
        _text('label', 'middle', along, y_label),
    ]


def _text(kind: str, anchor: str, place: str, text: str) -> str:
    return f'<text class="{kind}" text-anchor="{anchor}" {place}>{escape(text)}</text>'


def _drawn(line: Line) -> list[str]:
    pieces: list[list[str]] = [[]]
    for x, y in line.points:
        if x is None or y is None:
            pieces.append([])
        else:
            pieces[-1].append(f'{_x(x):.1f},{_y(y):.1f}')
    dash = ' stroke-dasharray="5 4"' if line.dashed else ''
    parts = [
        f'<polyline fill="none" stroke="{line.colour}" stroke-width="2"{dash} '
        f'points="{" ".join(piece)}"><title>{escape(line.name)}</title></polyline>'
        for piece in pieces
        if len(piece) > 1
    ]
    if line.mark is not None and None not in line.mark:
        x, y = line.mark
        parts.append(
            f'<circle cx="{_x(x or 0.0):.1f}" cy="{_y(y or 0.0):.1f}" r="4.5" '
            f'fill="{line.colour}" stroke="white" stroke-width="1.5">'
            f'<title>{escape(line.name)}: in use</title></circle>'
        )
    return parts
