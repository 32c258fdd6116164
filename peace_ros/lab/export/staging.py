# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Bundles are built beside their place and put there complete, or not at all."""

from __future__ import annotations

import ctypes
import errno
import json
import os
import shutil
import tempfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import asdict
from pathlib import Path
from typing import Any

from peace_ros.core.domain import BundleError
from peace_ros.core.inference.bundle import MANIFEST_NAME, sha256_of
from peace_ros.core.inference.manifest import FORMAT, ROLES_BY_FAMILY, InputSpec

_AT_FDCWD, _RENAME_EXCHANGE = -100, 2  # fcntl.h, linux/fs.h
_NO_ROOM = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)


@contextmanager
def staged(folder: Path) -> Iterator[Path]:
    """Give a folder to fill; without an error it then takes the place of ``folder``.

    Raises BundleError when the disk is full or the folder cannot be written.
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
            f'{folder}: {error.strerror or error}; {remedy} (an older bundle there is unchanged)'
        ) from error


def write_manifest(
    folder: Path, name: str, family: str, inputs: Mapping[str, InputSpec], **values: Any
) -> None:
    """Write manifest.json, the last file of a bundle: it holds the checksums of the others.

    Args:
        folder: holds a file for each role of the family, named after it.
        name: of the bundle.
        family: of the bundle.
        inputs: ``input``, and for fastsam ``crop_input``.
        values: the other keys of the manifest.
    """
    roles = {
        role: 'tokenizer.json' if role == 'tokenizer' else f'{role}.onnx'
        for role in ROLES_BY_FAMILY[family]
    }
    manifest = {'format': FORMAT, 'name': name, 'family': family, 'roles': roles}
    manifest |= {key: asdict(spec) for key, spec in inputs.items()} | values
    manifest['files'] = {file: file_entry(folder / file) for file in roles.values()}
    _write(folder, manifest)


def change_manifest(folder: Path, **values: Any) -> None:
    """Replace or add keys of a bundle's manifest."""
    _write(folder, json.loads((folder / MANIFEST_NAME).read_text(encoding='utf-8')) | values)


def _write(folder: Path, manifest: Mapping[str, Any]) -> None:
    (folder / MANIFEST_NAME).write_text(json.dumps(manifest, indent=2) + '\n', encoding='utf-8')


def file_entry(path: Path) -> dict[str, str | int]:
    """Return what a manifest says of a file: its SHA-256 and its size."""
    return {'sha256': sha256_of(path), 'bytes': path.stat().st_size}


def put_in_place(stage: Path, folder: Path) -> None:
    """Let a finished folder take the place of another beside it; raises OSError.

    Both are exchanged in one step where the file system can, so that a kill at any time leaves a
    bundle of that name. Elsewhere an older bundle is set aside first, and comes back when the new
    one cannot be moved.
    """
    if folder.exists() and _exchanged(stage, folder):
        shutil.rmtree(stage, ignore_errors=True)
        return
    old = folder.with_name(f'.{folder.name}.old')
    if folder.exists():
        shutil.rmtree(old, ignore_errors=True)
        folder.rename(old)
    try:
        stage.rename(folder)
    except OSError:
        if old.exists():
            old.rename(folder)
        raise
    shutil.rmtree(old, ignore_errors=True)


def _exchanged(one: Path, other: Path) -> bool:
    """Exchange two names by renameat2(2); return whether it was done."""
    try:
        rename = ctypes.CDLL(None, use_errno=True).renameat2
    except (AttributeError, OSError):  # a system without it
        return False
    names = (os.fsencode(one), os.fsencode(other))
    return bool(rename(_AT_FDCWD, names[0], _AT_FDCWD, names[1], _RENAME_EXCHANGE) == 0)
