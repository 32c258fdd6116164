# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What the terminal shows while a demo runs: a live panel, or plain lines where there is no TTY."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import final

from rich.console import Console
from rich.live import Live
from rich.panel import Panel
from rich.table import Table
from rich.text import Text

_REFRESH_S = 0.25
_LINE_S = 1.0
_STYLES = {
    'HANDOVER': 'bold green',
    'LANDING': 'green',
    'AIMING': 'cyan',
    'SEARCHING': 'yellow',
    'HOLD': 'bold red',
    'ABORTED': 'bold red',
}


@dataclass(frozen=True)
class Snapshot:
    """What is worth showing at one moment."""

    phase: str = ''
    """What the demo does."""
    state: str = ''
    reason: str = ''
    altitude_agl_m: float | None = None
    prompt: str = ''
    site: str = ''
    rates: str = ''
    link: str = ''
    """What the autopilot says of itself, and how old that is."""

    def words(self) -> str:
        """Return the prompt as a person would read it."""
        return self.prompt.replace('{term}', '...')

    def line(self) -> str:
        """Return everything in one line."""
        altitude = '' if self.altitude_agl_m is None else f'{_tidy(self.altitude_agl_m):.1f} m'
        parts = (self.state, altitude, self.words(), self.site, self.rates)
        told = ' | '.join(part for part in parts if part)
        return f'{self.phase}: {told}' if told else self.phase


@final
class Progress:
    """Shows snapshots from a thread of its own until it is left."""

    def __init__(self, console: Console, take: Callable[[], Snapshot], title: str) -> None:
        """Prepare the display.

        Args:
            console: where to show.
            take: returns the newest snapshot; called from another thread.
            title: of the panel.
        """
        self._console = console
        self._take = take
        self._title = title
        self._stop = threading.Event()
        self._live: Live | None = None
        if console.is_terminal:
            self._live = Live(console=console, auto_refresh=False, transient=True)
        self._thread = threading.Thread(target=self._run, name='progress', daemon=True)

    def __enter__(self) -> Progress:
        """Begin to show."""
        if self._live is not None:
            self._live.start()
        self._thread.start()
        return self

    def __exit__(self, *_error: object) -> None:
        """Show the last snapshot and stop."""
        self._stop.set()
        self._thread.join(timeout=2.0)
        if self._live is not None:
            self._live.stop()

    def _run(self) -> None:
        last_line, last_s = '', 0.0
        while not self._stop.wait(_REFRESH_S):
            snapshot = self._take()
            if self._live is not None:
                self._live.update(self._panel(snapshot), refresh=True)
                continue
            line, now_s = snapshot.line(), time.monotonic()
            if line != last_line and now_s - last_s >= _LINE_S:
                self._console.print(line, markup=False, highlight=False, soft_wrap=True)
                last_line, last_s = line, now_s

    def _panel(self, snapshot: Snapshot) -> Panel:
        table = Table.grid(padding=(0, 2))
        table.add_column(style='dim', no_wrap=True)
        table.add_column()
        altitude = snapshot.altitude_agl_m
        table.add_row('now', snapshot.phase)
        table.add_row(
            'state', Text(snapshot.state or '-', style=_STYLES.get(snapshot.state, 'bold'))
        )
        table.add_row('why', Text(snapshot.reason or '-'))
        table.add_row('altitude', '-' if altitude is None else _altitude_bar(altitude))
        table.add_row('prompt', Text(snapshot.words() or '-'))
        table.add_row('site', Text(snapshot.site or '-'))
        table.add_row('rates', Text(snapshot.rates or '-'))
        table.add_row('link', Text(snapshot.link or '-'))
        return Panel(table, title=self._title, title_align='left', border_style='blue')


def _tidy(altitude_m: float) -> float:
    """Return the altitude to 0.1 m, never as minus zero."""
    return round(altitude_m, 1) + 0.0


def _altitude_bar(altitude_m: float) -> Text:
    cells = 40
    filled = round(min(max(altitude_m, 0.0), 100.0) / 100.0 * cells)
    text = Text(f'{_tidy(altitude_m):6.1f} m  ')
    text.append('=' * filled, style='cyan')
    text.append('-' * (cells - filled), style='dim')
    return text
