# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Bundles are filled beside their place and put there whole, or not at all."""

from __future__ import annotations

import errno
import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from peace_ros.core.domain import BundleError
from peace_ros.core.inference.bundle import put_in_place

_NO_ROOM = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)


@contextmanager
def staged(folder: Path) -> Iterator[Path]:
    """Give a folder to fill; when that went well, it takes the place of ``folder``.

    Raises BundleError when there is no room or no right to write.
    """
    folder = folder.expanduser().absolute()
    try:
        folder.parent.mkdir(parents=True, exist_ok=True)
        stage = Path(tempfile.mkdtemp(prefix=f'.{folder.name}.', dir=folder.parent))
        stage.chmod(0o755)
        try:
            yield stage
            put_in_place(stage, folder)
        finally:
            shutil.rmtree(stage, ignore_errors=True)
    except OSError as error:
        remedy = (
            'a full-size bundle needs up to 3 GB while it is made: free some space or choose '
            'another folder'
            if error.errno in _NO_ROOM
            else 'choose a folder that can be written'
        )
        raise BundleError(
            f'{folder}: {error.strerror or error}; {remedy} (a bundle that was there is untouched)'
        ) from error
