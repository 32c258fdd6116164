# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What the terminal shows: a panel on a TTY, few plain lines elsewhere."""

from __future__ import annotations

import io
import time

from rich.console import Console

from peace_ros.simulation.demo.progress import Progress, Snapshot

SHOWN = Snapshot(
    phase='flown by the landing node',
    state='AIMING',
    reason='a site is known',
    altitude_agl_m=57.25,
    prompt='A rendered image of {term} in fog.',
    site='+10 m north',
    rates='12 heatmaps',
    link='GUIDED, follows us, 0.1 s old',
)


def test_without_a_tty_a_line_comes_on_change_and_at_most_once_a_second(monkeypatch) -> None:
    monkeypatch.setattr('peace_ros.simulation.demo.progress._REFRESH_S', 0.01)
    monkeypatch.setattr('peace_ros.simulation.demo.progress._LINE_S', 0.2)
    out = io.StringIO()
    changing = iter(Snapshot(phase=f'step {k}') for k in range(10_000))
    with Progress(Console(file=out, force_terminal=False), lambda: next(changing), 'demo'):
        time.sleep(0.7)
    assert 2 <= len(out.getvalue().splitlines()) <= 5
    out = io.StringIO()
    with Progress(Console(file=out, force_terminal=False, width=60), lambda: SHOWN, 'demo'):
        time.sleep(0.5)
    (line,) = out.getvalue().splitlines()
    for part in (
        'AIMING',
        '57.2 m',
        'A rendered image of ... in fog.',
        '+10 m north',
        '12 heatmaps',
    ):
        assert part in line


def test_a_tty_gets_one_panel_with_everything(monkeypatch) -> None:
    monkeypatch.setattr('peace_ros.simulation.demo.progress._REFRESH_S', 0.01)
    out = io.StringIO()
    with Progress(Console(file=out, force_terminal=True, width=100), lambda: SHOWN, 'peace demo'):
        time.sleep(0.3)
    told = out.getvalue()
    for part in (
        'peace demo',
        'AIMING',
        'a site is known',
        '57.2 m',
        'in fog',
        '+10 m north',
        'GUIDED, follows us',
    ):
        assert part in told


def test_the_ground_is_never_below_zero() -> None:
    assert '-0.0' not in Snapshot(altitude_agl_m=-0.02).line()
