# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A cache of tiles in one MBTiles file (specification 1.3), which other map tools open too."""

from __future__ import annotations

import sqlite3
from pathlib import Path

from peace_ros.core.domain import WorldError

_TABLES = """
CREATE TABLE IF NOT EXISTS metadata (name TEXT PRIMARY KEY, value TEXT);
CREATE TABLE IF NOT EXISTS tiles (
    zoom_level INTEGER, tile_column INTEGER, tile_row INTEGER, tile_data BLOB,
    PRIMARY KEY (zoom_level, tile_column, tile_row));
"""


class TileCache:
    """Tiles on disk; rows are counted from the north as in XYZ (MBTiles counts from the south).

    Args:
        path: of the file; created when missing.

    Raises:
        WorldError: it is damaged, no MBTiles file, or cannot be written.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            self._file = sqlite3.connect(path, timeout=30.0)
            self._file.executescript(_TABLES)
        except (OSError, sqlite3.Error) as error:
            raise self._problem(error) from error

    def close(self) -> None:
        """Close the file."""
        self._file.close()

    def get(self, zoom: int, x: int, y: int) -> bytes | None:
        """Return a tile as it was served, None where it is not here."""
        where = 'zoom_level = ? AND tile_column = ? AND tile_row = ?'
        key = (zoom, x, 2**zoom - 1 - y)
        try:
            # The condition is a constant of this file.
            found = self._file.execute(f'SELECT tile_data FROM tiles WHERE {where}', key).fetchone()  # noqa: S608
        except sqlite3.Error as error:
            raise self._problem(error) from error
        return None if found is None else bytes(found[0])

    def put(self, zoom: int, x: int, y: int, data: bytes) -> None:
        """Keep a tile."""
        self._write(
            'INSERT OR REPLACE INTO tiles VALUES (?, ?, ?, ?)', (zoom, x, 2**zoom - 1 - y, data)
        )

    def describe(self, **values: str) -> None:
        """Keep metadata: `template`, `attribution`."""
        for name, value in values.items():
            self._write('INSERT OR REPLACE INTO metadata VALUES (?, ?)', (name, value))

    def metadata(self) -> dict[str, str]:
        """Return all metadata."""
        try:
            return dict(self._file.execute('SELECT name, value FROM metadata').fetchall())
        except sqlite3.Error as error:
            raise self._problem(error) from error

    def count(self) -> int:
        """Return the number of tiles."""
        try:
            return int(self._file.execute('SELECT COUNT(*) FROM tiles').fetchone()[0])
        except sqlite3.Error as error:
            raise self._problem(error) from error

    def _write(self, statement: str, values: tuple[object, ...]) -> None:
        try:
            with self._file:
                self._file.execute(statement, values)
        except sqlite3.Error as error:
            raise self._problem(error) from error

    def _problem(self, error: Exception) -> WorldError:
        return WorldError(
            f'cache of tiles {self.path} cannot be used ({error}): give another --cache, or move '
            'the file away'
        )
