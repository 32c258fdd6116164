# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The folder of a run's results, never over those of another run, and files that are whole."""

from __future__ import annotations

from contextlib import suppress
from pathlib import Path

from peace_ros.core.domain import ConfigurationError, RecordingError

RUNS = Path('runs')


def create_run_folder(chosen: Path | None, name: str, option: str) -> Path:
    """Return the absolute path of an empty folder, created.

    Args:
        chosen: must be empty or new; None takes ``runs/<name>`` under the current folder, or
            ``runs/<name>_2`` and so on when there is one already.
        name: of a run for which no folder was chosen.
        option: with which the user may choose, quoted in errors.

    Raises:
        ConfigurationError: it holds something already or cannot be created.
    """
    try:
        if chosen is None:
            return _create_new(RUNS / name).resolve()
        chosen.mkdir(parents=True, exist_ok=True)
        occupied = any(chosen.iterdir())
    except OSError as error:
        raise ConfigurationError(
            f'folder {chosen or RUNS / name} cannot be used ({error.strerror}): give {option} DIR'
        ) from error
    if occupied:
        raise ConfigurationError(f'folder {chosen} is not empty: give another {option}')
    return chosen.resolve()


def _create_new(folder: Path) -> Path:
    """Create the folder or its first free namesake; of two runs at once each gets its own."""
    folder.parent.mkdir(parents=True, exist_ok=True)
    wanted, number = folder, 1
    while True:
        with suppress(FileExistsError):
            wanted.mkdir()
            return wanted
        number += 1
        wanted = folder.with_name(f'{folder.name}_{number}')


def write_whole(path: Path, content: bytes | str, what: str) -> None:
    """Write a file that appears under its name only when it is complete.

    Raises:
        RecordingError: the place cannot be written to; the message begins with ``what``.
    """
    partial = path.with_name(f'.{path.name}.partial')
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        partial.write_bytes(content if isinstance(content, bytes) else content.encode())
        partial.replace(path)
    except OSError as error:
        with suppress(OSError):  # what stands in the way may also stand here
            partial.unlink()
        raise RecordingError(
            f'{what} {path} cannot be written ({error}): give a folder that is writable'
        ) from error
