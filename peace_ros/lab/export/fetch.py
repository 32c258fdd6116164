# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Named bundles from an index: resumable, checked, put in place whole or not at all."""

from __future__ import annotations

import json
import re
import urllib.error
import urllib.request
from http.client import HTTPException
from pathlib import Path
from typing import TYPE_CHECKING, Any
from urllib.parse import urljoin, urlsplit

from peace_ros.core.domain import BundleError
from peace_ros.core.inference.bundle import MANIFEST_NAME, Bundle, put_in_place, sha256_of
from peace_ros.core.inference.manifest import FileEntry, parse_manifest

if TYPE_CHECKING:
    from collections.abc import Callable

    Progress = Callable[[str, int, int], None]
    """Takes file, bytes so far and bytes in all."""

_CHUNK_BYTES = 1 << 18
_TIMEOUT_S = 30.0
_NAME = re.compile(r'[A-Za-z0-9_][A-Za-z0-9_.\-]*')
_SCHEMES = ('http', 'https', 'file')
_BROKEN = (HTTPException, ConnectionError, TimeoutError)


def fetch_bundle(name: str, index: str, folder: Path, progress: Progress) -> Bundle:
    """Download a bundle that an index names.

    Args:
        name: of the bundle in the index.
        index: URL or file of a JSON object, name -> {"url": of its folder, "sha256": of its
            manifest}; relative URLs start at the index.
        folder: where the bundle goes; one that is there stays until the new one is whole.
        progress: called as bytes come in.

    Raises:
        BundleError: no network, no such bundle, a file that differs from its checksum, no room.
            What was downloaded so far is kept beside the folder, and the next call goes on there.
    """
    where = index if '://' in index else Path(index).expanduser().absolute().as_uri()
    entry = _entry(name, where)
    base = urljoin(where, str(entry['url']).rstrip('/') + '/')
    folder = folder.expanduser().absolute()
    parts = folder.with_name(f'.{folder.name}.part')
    try:
        parts.mkdir(parents=True, exist_ok=True)
        manifest_path = parts / MANIFEST_NAME
        manifest_path.write_bytes(_read(base + MANIFEST_NAME))
        _check(manifest_path, str(entry['sha256']))
        manifest = parse_manifest(manifest_path.read_bytes(), str(manifest_path))
        for file, expected in manifest.files.items():
            _download(base + file, parts / file, expected, progress)
        Bundle.load(parts)
        put_in_place(parts, folder)
    except OSError as error:
        raise BundleError(
            f'{folder}: {error.strerror or error}; free some space or choose another folder '
            '(a bundle that was there is untouched)'
        ) from error
    return Bundle.load(folder)


def _entry(name: str, index: str) -> dict[str, Any]:
    try:
        names = json.loads(_read(index))
        entry = names.get(name)
    except (ValueError, AttributeError) as error:
        raise BundleError(f'{index}: not an index of bundles ({error}); check --index') from error
    is_whole = isinstance(entry, dict) and {'url', 'sha256'} <= {*entry}
    if not _NAME.fullmatch(name) or not is_whole:
        raise BundleError(
            f'no bundle {name!r} in {index}: it has {", ".join(sorted(names)) or "none"}'
        )
    return entry


def _open(url: str, start: int = 0) -> Any:
    if urlsplit(url).scheme not in _SCHEMES:
        raise BundleError(f'{url}: give a URL that begins with {", ".join(_SCHEMES)}')
    request = urllib.request.Request(url)  # noqa: S310 - the scheme was checked
    if start:
        request.add_header('Range', f'bytes={start}-')
    try:
        return urllib.request.urlopen(request, timeout=_TIMEOUT_S)  # noqa: S310
    except urllib.error.HTTPError as error:
        raise BundleError(
            f'{url}: the server says {error.code} {error.reason}; check --index or ask who keeps it'
        ) from error
    except (urllib.error.URLError, *_BROKEN) as error:
        remedy = (
            'check the path'
            if urlsplit(url).scheme == 'file'
            else 'check the network and call again, what has come is kept'
        )
        reason = getattr(error, 'reason', error)
        raise BundleError(f'{url}: cannot be reached ({reason}); {remedy}') from error


def _read(url: str) -> bytes:
    with _open(url) as response:
        return b''.join(iter(lambda: _next_chunk(response, url), b''))


def _next_chunk(response: Any, url: str) -> bytes:
    try:
        chunk: bytes = response.read(_CHUNK_BYTES)
    except _BROKEN as error:
        raise BundleError(
            f'{url}: the connection broke ({error or type(error).__name__}); call again, the '
            'download goes on where it stopped'
        ) from error
    return chunk


def _download(url: str, path: Path, expected: FileEntry, progress: Progress) -> None:
    have = path.stat().st_size if path.is_file() else 0
    if have > expected.bytes:
        path.unlink()
        have = 0
    if have < expected.bytes:
        with _open(url, have) as response:
            # A server that knows no ranges sends the whole file again.
            goes_on = have > 0 and getattr(response, 'status', None) == 206
            have = have if goes_on else 0
            with path.open('ab' if goes_on else 'wb') as file:
                while chunk := _next_chunk(response, url):
                    file.write(chunk)
                    have += len(chunk)
                    progress(path.name, have, expected.bytes)
    if have != expected.bytes:
        raise BundleError(
            f'{url}: {have} of {expected.bytes} bytes came; call again, the download goes on there'
        )
    _check(path, expected.sha256)


def _check(path: Path, sha256: str) -> None:
    found = sha256_of(path)
    if found != sha256:
        path.unlink()
        raise BundleError(
            f'{path.name}: SHA-256 {found} where {sha256} is due; it was removed, call again or '
            'ask who keeps the index'
        )
