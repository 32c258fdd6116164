# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Tiles from a server, each asked for once: politely, with pauses, and kept in a cache."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from urllib.parse import urlsplit

import cv2
import numpy as np
import requests
from numpy.typing import NDArray

from peace_ros import __version__
from peace_ros.core.domain import ConfigurationError, WorldError
from peace_ros.simulation.tiles.cache import TileCache
from peace_ros.simulation.tiles.mercator import FINEST_ZOOM, TILE_PX, quadkey

USER_AGENT = f'peace_ros/{__version__} (simulation of drone landings)'
_TIMEOUT_S = 20.0
_TRIES = 4
_MOST_BYTES = 4 << 20
_BUSY = frozenset({429, 500, 502, 503, 504})
"""Answers after which it is worth to ask again later."""


@dataclass(frozen=True)
class TileServer:
    """Where tiles come from.

    The template is a URL with {z}, {x} and {y}; or {-y}, rows counted from the south (TMS); or
    {q}, a quadkey. ``@2x`` in it gives tiles of 512 pixels.
    """

    template: str
    attribution: str
    """What the provider wants to be written in each picture."""
    requests_per_s: float = 2.0

    def __post_init__(self) -> None:
        names = {'{q}'} if '{q}' in self.template else {'{z}', '{x}'}
        has_row = '{q}' in self.template or '{y}' in self.template or '{-y}' in self.template
        missing = sorted(name for name in names if name not in self.template)
        if missing or not has_row:
            lacks = ', '.join([*missing, *([] if has_row else ['{y}'])])
            raise ConfigurationError(
                f'URL of tiles {self.template} lacks {lacks}: give {{z}}, {{x}} and {{y}}, or {{q}}'
            )
        if urlsplit(self.template).scheme not in {'http', 'https'}:
            raise ConfigurationError(f'URL of tiles {self.template}: give one of http or https')
        if not self.attribution.strip():
            raise ConfigurationError(
                'no attribution: give --attribution TEXT, as the provider of the tiles asks for it'
            )
        if not 0.1 <= self.requests_per_s <= 50.0:
            raise ConfigurationError(f'{self.requests_per_s} requests per second: give 0.1 to 50')

    def url(self, zoom: int, x: int, y: int) -> str:
        """Return the address of a tile."""
        values = {
            '{z}': str(zoom),
            '{x}': str(x),
            '{y}': str(y),
            '{-y}': str(2**zoom - 1 - y),
            '{q}': quadkey(x, y, zoom),
        }
        url = self.template
        for name, value in values.items():
            url = url.replace(name, value)
        return url


class TileSource:
    """Tiles by number, from the cache or else from the server.

    Args:
        cache: is asked first and keeps what comes.
        server: None works offline, from the cache only.
        sleep: waits some seconds; for tests.
    """

    def __init__(
        self,
        cache: TileCache,
        server: TileServer | None,
        sleep: Callable[[float], None] = time.sleep,
    ) -> None:
        self._cache, self._server, self._sleep = cache, server, sleep
        self._session = requests.Session()
        self._session.headers['User-Agent'] = USER_AGENT
        self._next_s = 0.0
        self.fetched = 0
        """Tiles that came from the server."""
        if server is not None:
            cache.describe(template=server.template, attribution=server.attribution)

    def tile(self, zoom: int, x: int, y: int) -> NDArray[np.uint8]:
        """Return a tile, side x side x 3, RGB; the side is 256 or 512 pixels.

        Raises:
            WorldError: it is not in the cache, there is none, or the server refuses.
        """
        if not 0 <= zoom <= FINEST_ZOOM:
            raise ConfigurationError(f'zoom {zoom}: give 0 to {FINEST_ZOOM}')
        data = self._cache.get(zoom, x, y)
        if data is not None:
            return _picture(data, f'{self._cache.path}, tile {zoom}/{x}/{y}')
        if self._server is None:
            raise WorldError(
                f'{self._cache.path} lacks tile {zoom}/{x}/{y}: fetch this place once without '
                '--offline'
            )
        url = self._server.url(zoom, x, y)
        data = self._asked(url)
        picture = _picture(data, url)
        self._cache.put(zoom, x, y, data)
        self.fetched += 1
        return picture

    def _asked(self, url: str) -> bytes:
        problem = ''
        for attempt in range(_TRIES):
            self._wait(2.0**attempt if attempt else 0.0)
            try:
                answer = self._session.get(url, timeout=_TIMEOUT_S)
            except requests.RequestException as error:
                problem = f'no answer ({type(error).__name__})'
                continue
            if answer.status_code == requests.codes.ok:
                return bytes(answer.content)
            problem = f'status {answer.status_code}'
            if answer.status_code == requests.codes.not_found:
                raise WorldError(f'no tile at {url} (status 404): give another place or --zoom')
            if answer.status_code not in _BUSY:
                break
        raise WorldError(
            f'the server of tiles does not give {url}: {problem}; see its terms, its key in the '
            'URL, or try later: what came so far is in the cache'
        )

    def _wait(self, longer_s: float) -> None:
        """Keep the pause between two requests; a refused one is followed by a longer pause."""
        rate = self._server.requests_per_s if self._server is not None else 1.0
        pause_s = max(self._next_s - time.monotonic(), longer_s)
        if pause_s > 0.0:
            self._sleep(pause_s)
        self._next_s = time.monotonic() + 1.0 / rate


def _picture(data: bytes, where: str) -> NDArray[np.uint8]:
    if len(data) > _MOST_BYTES:
        raise WorldError(f'{where} has {len(data)} bytes, more than {_MOST_BYTES}: no tile')
    raw = np.frombuffer(data, np.uint8)
    picture = cv2.imdecode(raw, cv2.IMREAD_COLOR) if raw.size else None
    if picture is None:
        begin = data[:40].decode('ascii', 'replace').split('\n')[0]
        raise WorldError(
            f'{where} is no picture (it begins with {begin!r}): see the terms of the server and '
            'the key in the URL'
        )
    if picture.shape[:2] not in {(TILE_PX, TILE_PX), (2 * TILE_PX, 2 * TILE_PX)}:
        raise WorldError(
            f'{where} has {picture.shape[1]} x {picture.shape[0]} px: tiles have 256 or 512 px'
        )
    return np.asarray(cv2.cvtColor(picture, cv2.COLOR_BGR2RGB), np.uint8)
