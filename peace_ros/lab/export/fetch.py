# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Named bundles from an index, downloaded by pooch: resumable, checked, put in place whole."""

from __future__ import annotations

import fcntl
import json
import logging
import os
import re
import shutil
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from time import monotonic
from typing import IO, Any
from urllib.parse import urljoin, urlsplit
from urllib.request import url2pathname

from peace_ros.core.domain import BundleError
from peace_ros.core.inference.bundle import MANIFEST_NAME, Bundle
from peace_ros.core.inference.manifest import parse_manifest
from peace_ros.lab.export.staging import put_in_place

Progress = Callable[[str, int, int], None]
"""Takes file, bytes so far and bytes in all."""

_CHUNK_BYTES = 1 << 18
_MOST_JSON_BYTES = 1 << 20
_NAME = re.compile(r'[A-Za-z0-9_][A-Za-z0-9_.\-]*')
_SCHEMES = ('http', 'https', 'file')
_LONGEST_S = 4 * 3600.0
"""Of a whole fetch: a server that sends a byte now and then must not hold it without an end."""


def fetch_bundle(name: str, index: str, folder: Path, progress: Progress) -> Bundle:
    """Download a bundle that an index names.

    Args:
        name: of the bundle in the index.
        index: URL or file of a JSON object, name -> {"url": of its folder, "sha256": of its
            manifest}; relative URLs start at the index.
        folder: where the bundle goes; an older one there stays until the new one is complete.
        progress: called as bytes arrive.

    Raises:
        BundleError: no network, no such bundle, a file that differs from its checksum or is larger
            than its manifest says, no free space, pooch is not installed. What was downloaded so
            far is kept beside the folder, and the next call continues there.
    """
    where = index if '://' in index else Path(index).expanduser().absolute().as_uri()
    folder = folder.expanduser().absolute()
    parts = folder.with_name(f'.{folder.name}.part')
    end_s = monotonic() + _LONGEST_S
    try:
        with TemporaryDirectory() as aside:
            listing = _retrieve(where, Path(aside) / 'index.json', None, _MOST_JSON_BYTES, end_s)
            entry = _entry(name, where, listing.read_bytes())
        base = urljoin(where, str(entry['url']).rstrip('/') + '/')
        _refuse_less_safe(where, base)
        with _alone(parts):
            # A manifest is small and may have changed: it is always downloaded anew.
            (parts / MANIFEST_NAME).unlink(missing_ok=True)
            known = str(entry['sha256'])
            place = parts / MANIFEST_NAME
            path = _retrieve(base + MANIFEST_NAME, place, known, _MOST_JSON_BYTES, end_s)
            for file, expected in parse_manifest(path.read_bytes(), str(path)).files.items():
                place, known = parts / file, expected.sha256
                _retrieve(base + file, place, known, expected.bytes, end_s, progress)
            Bundle.load(parts)
            put_in_place(parts, folder)
    except OSError as error:
        raise BundleError(
            f'{folder}: {error.strerror or error}; free some space or choose another folder '
            '(an older bundle there is unchanged)'
        ) from error
    return Bundle.load(folder)


def _entry(name: str, index: str, content: bytes) -> dict[str, Any]:
    try:
        names = json.loads(content)
        entry = names.get(name)
    except (ValueError, AttributeError) as error:
        raise BundleError(f'{index}: not an index of bundles ({error}); check --index') from error
    is_complete = isinstance(entry, dict) and {'url', 'sha256'} <= {*entry}
    if not _NAME.fullmatch(name) or not is_complete:
        raise BundleError(
            f'no bundle {name!r} in {index}: it has {", ".join(sorted(names)) or "none"}'
        )
    return entry


def _refuse_less_safe(from_url: str, to_url: str) -> None:
    """Refuse an index or a redirection that leads to a less safe kind of address."""
    before, after = urlsplit(from_url).scheme, urlsplit(to_url).scheme
    if (before == 'https' and after != 'https') or (before != 'file' and after == 'file'):
        raise BundleError(
            f'{from_url} leads to {to_url}: from {before} only {before} or https may follow; ask '
            'the maintainer of the index'
        )


@contextmanager
def _alone(parts: Path) -> Iterator[None]:
    """Make the folder of a download, and keep others out of it meanwhile."""
    if parts.is_symlink():
        raise BundleError(f'{parts} is a symbolic link: remove it')
    parts.mkdir(parents=True, exist_ok=True)
    handle = os.open(parts, os.O_RDONLY | os.O_DIRECTORY)
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        yield
    except BlockingIOError as error:
        raise BundleError(
            f'{parts}: another download of this bundle is under way: wait for its end'
        ) from error
    finally:
        os.close(handle)


def _retrieve(
    url: str,
    path: Path,
    sha256: str | None,
    most_bytes: int,
    end_s: float,
    progress: Progress | None = None,
) -> Path:
    """Let pooch download and check a file unless it is there already; return its path."""
    if path.is_symlink():
        path.unlink()  # nothing outside of the folder is read or written
    try:
        import pooch  # noqa: PLC0415 - an extra, for this verb alone
        import requests  # noqa: PLC0415 - comes with pooch
    except ImportError as error:
        raise BundleError(
            f'downloads need {error.name}: install the extra "fetch" '
            '(pip install -e ".[fetch]" in the checkout)'
        ) from error
    if urlsplit(url).scheme not in _SCHEMES:
        raise BundleError(f'{url}: give a URL that begins with {", ".join(_SCHEMES)}')
    pooch.get_logger().setLevel(logging.WARNING)
    try:
        known = None if sha256 is None else f'sha256:{sha256}'
        download = _Download(path, most_bytes, end_s, progress)
        pooch.retrieve(url, known, path.name, path.parent, downloader=download)
    except ValueError as error:
        raise BundleError(
            f'{url}: its SHA-256 is not the announced {sha256}; it was removed, call again or ask '
            'the maintainer of the index'
        ) from error
    except (requests.RequestException, FileNotFoundError) as error:
        raise BundleError(
            f'{url}: cannot be read ({error}); check --index and the network, then call again: '
            'the download continues where it stopped'
        ) from error
    return path


class _Download:
    """A downloader for pooch that continues a partial file and stops at the announced size."""

    def __init__(
        self, path: Path, most_bytes: int, end_s: float, progress: Progress | None
    ) -> None:
        self._path, self._most_bytes, self._progress = path, most_bytes, progress
        self._end_s = end_s
        self._url = ''
        self._file: IO[bytes]

    def __call__(self, url: str, target: str, _: Any) -> None:
        """Download to the file that pooch will check."""
        from pooch import HTTPDownloader  # noqa: PLC0415

        self._url = url
        if urlsplit(url).scheme == 'file':
            source = Path(url2pathname(urlsplit(url).path))
            if source.exists() and (
                not source.is_file() or source.stat().st_size > self._most_bytes
            ):
                raise BundleError(
                    f'{source} is not a file of at most {self._most_bytes} bytes: check --index'
                )
            shutil.copyfile(source, target)
            return
        with self._path.open('ab') as self._file:
            headers = {'Accept-Encoding': 'identity'}
            if have := self._file.tell():
                headers['Range'] = f'bytes={have}-'
            if have < self._most_bytes:
                HTTPDownloader(
                    chunk_size=_CHUNK_BYTES, headers=headers, hooks={'response': self._begin}
                )(url, self, None)
        self._path.replace(target)

    def _begin(self, response: Any, **_: Any) -> None:
        """Start over where a server ignores ranges and sends the whole file again."""
        _refuse_less_safe(self._url, response.url)
        if response.status_code == 200:
            self._file.seek(0)
            self._file.truncate()

    def write(self, chunk: bytes) -> None:
        """Append to the partial file; raises BundleError beyond the announced size."""
        self._file.write(chunk)
        have = self._file.tell()
        if have > self._most_bytes:
            self._path.unlink()
            raise BundleError(
                f'{self._path.name}: more than the announced {self._most_bytes} bytes came; it was '
                'removed, ask the maintainer of the index'
            )
        if monotonic() > self._end_s:
            raise BundleError(
                f'{self._path.name}: the download takes longer than {_LONGEST_S / 3600:g} h: call '
                'again, it continues where it stopped'
            )
        if self._progress:
            self._progress(self._path.name, have, self._most_bytes)

    def flush(self) -> None:
        """Do what pooch asks of a file."""
        self._file.flush()
