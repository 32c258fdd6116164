# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Model bundles: a folder with manifest.json, ONNX files and tokenizer.json, checked on load."""

from __future__ import annotations

import hashlib
import mmap
import os
import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType

from peace_ros.core.domain import BundleError
from peace_ros.core.inference.manifest import FileEntry, Manifest, parse_manifest
from peace_ros.core.resources import models_dir

MANIFEST_NAME = 'manifest.json'
_CHUNK_BYTES = 1 << 20
_LOCATION = re.compile(rb'\x0a\x08location\x12([\x80-\xff][\x01-\x7f]|[\x01-\x7f])', re.DOTALL)


@dataclass(frozen=True)
class Bundle:
    """A model bundle whose files were all there, whole and unchanged when it was loaded."""

    folder: Path
    manifest: Manifest
    checksum: str
    """SHA-256 (hex) of the manifest, which holds that of every file: one name for all of it."""
    paths: Mapping[str, Path]
    """Role -> file."""

    @classmethod
    def load(cls, path_or_name: Path | str) -> Bundle:
        """Load from a folder, or by name: the bundles of the package, then the user's own.

        Raises BundleError that names the file, what is wrong with it and what to do. The graphs
        are compared with the tensors of their family when a session opens them.
        """
        folder = _find(path_or_name)
        manifest_path = folder / MANIFEST_NAME
        try:
            raw = manifest_path.read_bytes()
        except OSError as error:
            raise BundleError(
                f'{manifest_path}: {error.strerror}; a bundle is a folder with a {MANIFEST_NAME}'
            ) from error
        manifest = parse_manifest(raw, str(manifest_path))
        for name, entry in manifest.files.items():
            _check_file(folder / name, entry)
            _check_references(folder / name, manifest)
        paths = {role: folder / name for role, name in manifest.roles.items()}
        return cls(folder, manifest, hashlib.sha256(raw).hexdigest(), MappingProxyType(paths))

    def require_family(self, family: str) -> None:
        """Raise BundleError unless the bundle is of this family."""
        if self.manifest.family != family:
            raise BundleError(
                f'{self.folder / MANIFEST_NAME}: family is {self.manifest.family!r} where '
                f'{family!r} is needed; choose another bundle'
            )


def user_models_dir() -> Path:
    """Return the user's folder of bundles: PEACE_MODELS_DIR or one in the home directory."""
    return Path(os.environ.get('PEACE_MODELS_DIR', '~/.local/share/peace_ros/models')).expanduser()


def _find(path_or_name: Path | str) -> Path:
    folder = Path(path_or_name).expanduser()
    if folder.is_dir():
        return folder
    shipped = models_dir()
    name = str(path_or_name)
    if name and Path(name).name == name:
        for place in (shipped, user_models_dir()):
            if (place / name).is_dir():
                return place / name
    names = sorted(each.parent.name for each in shipped.glob(f'*/{MANIFEST_NAME}'))
    raise BundleError(
        f'no model bundle {name!r}: give a folder with a {MANIFEST_NAME} or the name of a '
        f'shipped bundle ({", ".join(names) or "none"} in {shipped})'
    )


def sha256_of(path: Path) -> str:
    """Return the SHA-256 of a file, in hex; raises OSError."""
    digest = hashlib.sha256()
    with path.open('rb') as file:
        while chunk := file.read(_CHUNK_BYTES):
            digest.update(chunk)
    return digest.hexdigest()


def _check_file(path: Path, entry: FileEntry) -> None:
    try:
        size = path.stat().st_size
        if size != entry.bytes:
            raise BundleError(
                f'{path}: {size} bytes where the manifest says {entry.bytes}; '
                'fetch or build the bundle again'
            )
        found = sha256_of(path)
    except OSError as error:
        raise BundleError(
            f'{path}: {error.strerror}, yet the manifest lists it; fetch or build the bundle again'
        ) from error
    if found != entry.sha256:
        raise BundleError(
            f'{path}: SHA-256 {found} where the manifest says {entry.sha256}; '
            'the file was changed or damaged, fetch or build the bundle again'
        )


def _check_references(path: Path, manifest: Manifest) -> None:
    """Refuse a graph that keeps weights in a file that the manifest does not list.

    Such a file could be replaced while every checksum stays right. The graph names it in a pair
    of texts whose key is ``location`` (StringStringEntryProto of onnx.proto), which stands in the
    file as it is.
    """
    if path.suffix != '.onnx':
        return
    with path.open('rb') as file, mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as graph:
        for found in _LOCATION.finditer(graph):
            end = found.end()
            length = found[1][0] & 0x7F | (found[1][-1] << 7 if len(found[1]) == 2 else 0)
            name = bytes(graph[end : end + length]).decode('utf-8', 'replace')
            if name not in manifest.files:
                raise BundleError(
                    f'{path} keeps weights in {name!r}, which the manifest does not list: export '
                    'the bundle again'
                )
