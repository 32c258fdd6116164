# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The folder of the recordings: bounded files, the oldest removed, a full disk survived."""

from __future__ import annotations

import re
import shutil
import time
from collections import deque
from collections.abc import Callable, Mapping
from contextlib import suppress
from datetime import datetime, timezone
from pathlib import Path
from typing import final

from peace_ros.core.node_parameters import RecorderParameters
from peace_ros.recorder.flight_file import FlightFile, Note

_MB = 1_000_000
_NAME = re.compile(r'\d{8}T\d{6}Z(_\d+)?\.mcap')
_MOST_LATCHED = 100
_AGAIN_S = 10.0
"""After an error a new file is tried so much later."""

Say = Callable[[str], None]


@final
class RecordingStore:
    """Writes messages into files of a folder, and goes on when that fails for a while.

    Args:
        folder: is made.
        parameters: bounds of files, folder and disk.
        say: gets a sentence when recording stops or goes on; not for each message.
        now_s: of the steady clock.
    """

    def __init__(
        self,
        folder: Path,
        parameters: RecorderParameters,
        say: Say,
        now_s: Callable[[], float] = time.monotonic,
    ) -> None:
        self._folder, self._parameters, self._say, self._now_s = folder, parameters, say, now_s
        self._file: FlightFile | None = None
        self._latched: deque[Note] = deque(maxlen=_MOST_LATCHED)
        self._metadata: dict[str, Mapping[str, str]] = {}
        self._again_s = 0.0
        self.problem = ''
        """Why nothing is written now, empty while it is."""
        self.lost = 0
        """Messages that came while nothing could be written."""

    @property
    def path(self) -> Path | None:
        """The file in progress."""
        return None if self._file is None else self._file.path

    def add(self, note: Note) -> None:
        """Write a message; latched ones are at the beginning of each later file too."""
        if not self._attempt(lambda file: file.add(note)):
            self.lost += 1
        if note.latched:
            self._latched.append(note)

    def describe(self, name: str, values: Mapping[str, str]) -> None:
        """Write metadata, into each later file too."""
        self._attempt(lambda file: file.add_metadata(name, values))
        self._metadata[name] = values

    def flush(self) -> None:
        """Put everything on the disk; begin another file where this one is large enough."""
        if self._file is None or not self._attempt(lambda file: file.flush()):
            return
        if self.problem:
            self._say(f'recording goes on in {self._file.path}; {self.lost} messages were lost')
            self.problem = ''
        self._attempt(self._keep_bounds)

    def close(self) -> None:
        """Finish the file in progress."""
        file, self._file = self._file, None
        if file is not None:
            try:
                file.close()
            except OSError as error:
                self._say(f'{file.path} could not be finished: {error}')

    def _keep_bounds(self, file: FlightFile) -> None:
        if shutil.disk_usage(self._folder).free < self._parameters.least_free_mb * _MB:
            self._stop(
                f'less than {self._parameters.least_free_mb} MB are free in {self._folder}',
                close=True,
            )
        elif file.size_bytes >= self._parameters.file_mb * _MB:
            self.close()

    def _attempt(self, write: Callable[[FlightFile], None]) -> bool:
        """Write into the file in progress, or a new one; return whether it was done."""
        try:
            file = self._file or self._begin()
            if file is None:
                return False
            write(file)
        except OSError as error:
            self._stop(str(error))
            return False
        return True

    def _begin(self) -> FlightFile | None:
        if self._now_s() < self._again_s:
            return None
        self._folder.mkdir(parents=True, exist_ok=True)
        free = shutil.disk_usage(self._folder).free
        if free < self._parameters.least_free_mb * _MB:
            self._stop(f'{free // _MB} MB are free in {self._folder}')
            return None
        self._remove_oldest()
        file = self._file = FlightFile(self._free_name())
        for name, values in self._metadata.items():
            file.add_metadata(name, values)
        for note in self._latched:
            file.add(note)
        return file

    def _free_name(self) -> Path:
        now = datetime.now(timezone.utc).strftime('%Y%m%dT%H%M%SZ')
        path, number = self._folder / f'{now}.mcap', 1
        while path.exists():
            number += 1
            path = self._folder / f'{now}_{number}.mcap'
        return path

    def _stop(self, why: str, *, close: bool = False) -> None:
        """Do without a file for some time; say so once."""
        file, self._file = self._file, None
        if file is not None:
            with suppress(OSError):
                (file.close if close else file.abandon)()
        self._again_s = self._now_s() + _AGAIN_S
        if not self.problem:
            self._say(
                f'nothing is recorded: {why}; the landing is not affected, and it is tried again '
                f'every {_AGAIN_S:g} s'
            )
        self.problem = why

    def _remove_oldest(self) -> None:
        """Keep room for one more file within the bound of the folder."""
        found = sorted(each for each in self._folder.iterdir() if _NAME.fullmatch(each.name))
        sizes = {each: each.stat().st_size for each in found}
        room = (self._parameters.total_mb - self._parameters.file_mb) * _MB
        for each in found:
            if sum(sizes.values()) <= max(0, room):
                return
            each.unlink()
            del sizes[each]
