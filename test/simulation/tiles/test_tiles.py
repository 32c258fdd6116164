# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Tiles come from a server of this machine, and nothing else is asked."""

from __future__ import annotations

import re
import threading
from collections.abc import Iterator
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from math import cos, radians
from pathlib import Path

import cv2
import numpy as np
import pytest
import rasterio
from typer.testing import CliRunner

pytest.importorskip('requests')

from peace_ros.cli.main import app
from peace_ros.core.domain import ConfigurationError, WorldError
from peace_ros.simulation.tiles.cache import TileCache
from peace_ros.simulation.tiles.mercator import GeoPlace, gsd_m, place_of_tile, quadkey
from peace_ros.simulation.tiles.mosaic import PARIS, place_in, world_from_tiles
from peace_ros.simulation.tiles.source import USER_AGENT, TileServer, TileSource
from peace_ros.simulation.world import load_world

EIFFEL = GeoPlace(48.8583, 2.2945)
ATTRIBUTION = '© The makers of these tiles'


def tile_png(x: int, y: int, side: int = 256) -> bytes:
    """Return a tile whose colour tells its number."""
    image = np.full((side, side, 3), (x % 256, y % 256, 77), np.uint8)
    return bytes(cv2.imencode('.png', image[..., ::-1])[1])


class FakeServer:
    """Serves tiles at /z/x/y.png, and answers otherwise as a test wishes."""

    def __init__(self) -> None:
        self.asked: list[str] = []
        self.agents: set[str] = set()
        self.answers: list[tuple[int, bytes]] = []
        """Given first, one to each request."""
        self.side = 256
        outer = self

        class Handler(BaseHTTPRequestHandler):
            def do_GET(self) -> None:
                outer.asked.append(self.path)
                outer.agents.add(self.headers['User-Agent'])
                _, x, y = map(int, re.findall(r'\d+', self.path)[:3])
                status, body = (
                    outer.answers.pop(0) if outer.answers else (200, tile_png(x, y, outer.side))
                )
                self.send_response(status)
                self.send_header('Content-Length', str(len(body)))
                self.end_headers()
                self.wfile.write(body)

            def log_message(self, *_: object) -> None:
                pass

        self._server = ThreadingHTTPServer(('127.0.0.1', 0), Handler)
        self.template = f'http://127.0.0.1:{self._server.server_port}/{{z}}/{{x}}/{{y}}.png'
        threading.Thread(target=self._server.serve_forever, daemon=True).start()

    def close(self) -> None:
        self._server.shutdown()
        self._server.server_close()


@pytest.fixture
def server() -> Iterator[FakeServer]:
    fake = FakeServer()
    yield fake
    fake.close()


@pytest.fixture
def cache(tmp_path: Path) -> Iterator[TileCache]:
    kept = TileCache(tmp_path / 'tiles.mbtiles')
    yield kept
    kept.close()


def source_of(
    server: FakeServer, cache: TileCache, waited: list[float] | None = None, rate: float = 50.0
) -> TileSource:
    pauses = waited if waited is not None else []
    return TileSource(cache, TileServer(server.template, ATTRIBUTION, rate), pauses.append)


def test_known_tiles_and_scales() -> None:
    # Figures of the scheme: the whole map at zoom 0, and a tile that others have computed.
    assert GeoPlace(0.0, 0.0).tile(1) == pytest.approx((1.0, 1.0))
    assert [int(each) for each in EIFFEL.tile(16)] == [33185, 22545]
    assert gsd_m(0.0, 0) == pytest.approx(156543.034, abs=0.001)
    assert gsd_m(48.8583, 20) == pytest.approx(0.149291 * cos(radians(48.8583)), rel=1e-5)
    assert quadkey(3, 5, 3) == '213'
    back = place_of_tile(*EIFFEL.tile(20), 20)
    assert (back.latitude_deg, back.longitude_deg) == pytest.approx((48.8583, 2.2945), abs=1e-9)


def test_places_of_the_preset_lie_in_the_rectangle_of_the_paper() -> None:
    places = [place_in(PARIS, seed) for seed in range(50)]
    latitudes = [place.latitude_deg for place in places]
    longitudes = [place.longitude_deg for place in places]
    assert min(latitudes) > 48.837
    assert max(latitudes) < 48.881
    assert min(longitudes) > 2.295
    assert max(longitudes) < 2.390
    assert np.ptp(latitudes) > 0.03


def test_a_world_has_its_size_on_the_ground_and_its_tiles_in_place(server, cache) -> None:
    world = world_from_tiles(source_of(server, cache), EIFFEL, 120.0, zoom=19)
    assert world.size_m == pytest.approx((120.0, 120.0), abs=0.3)
    assert world.gsd_m == pytest.approx(gsd_m(EIFFEL.latitude_deg, 19))
    x, y = (int(each) for each in EIFFEL.tile(19))
    middle = world.image_rgb[world.image_rgb.shape[0] // 2, world.image_rgb.shape[1] // 2]
    assert middle.tolist() == [x % 256, y % 256, 77]
    east_of_it = int(world.image_rgb[world.image_rgb.shape[0] // 2, -1, 0])
    assert (east_of_it - x) % 256 in {1, 2}


def test_tiles_of_512_pixels_halve_the_size_of_a_pixel(server, cache) -> None:
    server.side = 512
    world = world_from_tiles(source_of(server, cache), EIFFEL, 60.0, zoom=19)
    assert world.gsd_m == pytest.approx(gsd_m(EIFFEL.latitude_deg, 19) / 2.0)
    assert world.size_m == pytest.approx((60.0, 60.0), abs=0.3)


def test_each_tile_is_asked_for_once_and_then_flown_offline(server, cache) -> None:
    first = world_from_tiles(source_of(server, cache), EIFFEL, 100.0, zoom=19)
    asked = len(server.asked)
    assert asked == len(set(server.asked)) == cache.count()
    assert server.agents == {USER_AGENT}
    again = world_from_tiles(TileSource(cache, None), EIFFEL, 100.0, zoom=19)
    assert np.array_equal(first.image_rgb, again.image_rgb)
    assert len(server.asked) == asked
    assert cache.metadata()['attribution'] == ATTRIBUTION
    with pytest.raises(WorldError, match=r'lacks tile 18/.* once without --offline'):
        world_from_tiles(TileSource(cache, None), EIFFEL, 100.0, zoom=18)


def test_requests_keep_their_pause(server, cache) -> None:
    waited: list[float] = []
    source = source_of(server, cache, waited, rate=2.0)
    for column in range(4):
        source.tile(19, column, 7)
    assert len(waited) == 3
    assert all(0.3 < pause <= 0.5 for pause in waited)


def test_a_busy_server_is_asked_again_later_and_longer(server, cache) -> None:
    waited: list[float] = []
    server.answers = [(503, b''), (429, b'')]
    assert source_of(server, cache, waited).tile(19, 3, 4)[0, 0].tolist() == [3, 4, 77]
    assert [round(pause) for pause in waited] == [2, 4]


@pytest.mark.parametrize(
    ('status', 'body', 'sentence'),
    [
        (403, b'', 'does not give .* status 403; see its terms'),
        (404, b'', r'no tile at .* \(status 404\): give another place or --zoom'),
        (200, b'<html>key missing</html>', 'is no picture .*<html>key missing</html>'),
        (200, b'', 'is no picture'),
        (200, tile_png(1, 2, 100), '100 x 100 px: tiles have 256 or 512 px'),
    ],
)
def test_what_is_no_tile_is_refused_and_not_kept(server, cache, status, body, sentence) -> None:
    server.answers = [(status, body)]
    with pytest.raises(WorldError, match=sentence):
        source_of(server, cache).tile(19, 3, 4)
    assert cache.count() == 0


def test_a_silent_server_is_reported(server, cache) -> None:
    source = source_of(server, cache)
    server.close()
    with pytest.raises(WorldError, match=r'no answer \(ConnectionError\)'):
        source.tile(19, 3, 4)


def test_a_cut_cache_file_is_refused_in_a_sentence(server, cache) -> None:
    source_of(server, cache).tile(19, 3, 4)
    cache.close()
    cut = cache.path.with_name('cut.mbtiles')
    cut.write_bytes(b'no data base' * 100)
    with pytest.raises(WorldError, match=r'cut.mbtiles cannot be used .*give another --cache'):
        TileCache(cut)


def test_a_picture_in_the_cache_that_is_damaged_is_named(server, cache) -> None:
    cache.put(19, 3, 4, tile_png(3, 4)[:60])
    with pytest.raises(WorldError, match=r'tiles.mbtiles, tile 19/3/4 is no picture'):
        TileSource(cache, None).tile(19, 3, 4)


@pytest.mark.parametrize(
    ('template', 'address'),
    [
        ('http://host/{z}/{x}/{y}@2x.png', 'http://host/3/5/2@2x.png'),
        ('http://host/{z}/{x}/{-y}.png', 'http://host/3/5/5.png'),
        ('https://host/t?k={q}', 'https://host/t?k=121'),
    ],
)
def test_templates(template, address) -> None:
    assert TileServer(template, ATTRIBUTION).url(3, 5, 2) == address


@pytest.mark.parametrize(
    ('template', 'attribution', 'sentence'),
    [
        ('http://host/{z}/{x}.png', 'x', r'lacks \{y\}'),
        ('file:///{z}/{x}/{y}', 'x', 'give one of http or https'),
        ('http://host/{z}/{x}/{y}', ' ', 'no attribution'),
    ],
)
def test_a_server_that_cannot_be_used_is_refused(template, attribution, sentence) -> None:
    with pytest.raises(ConfigurationError, match=sentence):
        TileServer(template, attribution)


def test_the_command_writes_a_geotiff_with_scale_and_attribution(server, tmp_path) -> None:
    out, cache = tmp_path / 'paris.tif', tmp_path / 'cache.mbtiles'
    common = ['--cache', str(cache), '--preset', 'paris', '--size', '80', '--zoom', '19']
    given = ['--url', server.template, '--attribution', ATTRIBUTION, '--rate', '50']
    done = CliRunner().invoke(app, ['world', 'tiles', '--out', str(out), *common, *given])
    assert done.exit_code == 0, done.output
    world = load_world(out)
    assert world.size_m == pytest.approx((80.0, 80.0), abs=0.3)
    # The reader measures on the ellipsoid, the scheme is a sphere: 0.2 % at this latitude.
    assert world.gsd_m == pytest.approx(gsd_m(place_in(PARIS, 1).latitude_deg, 19), rel=3e-3)
    with rasterio.open(out) as raster:
        assert raster.tags()['TIFFTAG_COPYRIGHT'] == ATTRIBUTION
    asked = len(server.asked)
    offline = ['world', 'tiles', '--out', str(tmp_path / 'b.tif'), *common, '--offline']
    assert CliRunner().invoke(app, offline).exit_code == 0
    assert len(server.asked) == asked
    told = CliRunner().invoke(app, ['world', 'info', str(cache)])
    assert f'{asked} tiles' in told.output
    assert ATTRIBUTION in told.output


@pytest.mark.parametrize(
    ('options', 'sentence'),
    [
        (['--offline'], 'give either --at LAT,LON or --preset paris'),
        (['--at', '48.8583,2.2945'], 'no --url of tiles'),
        (['--offline', '--at', 'Paris'], '--at Paris: give latitude,longitude'),
        (['--offline', '--preset', 'rome'], '--preset rome: choose one of paris'),
        (['--offline', '--at', '89.0,0.0'], 'give latitude within 85.05'),
    ],
)
def test_the_command_refuses_in_a_sentence(tmp_path, options, sentence) -> None:
    cache = ['--cache', str(tmp_path / 'c.mbtiles')]
    command = ['world', 'tiles', '--out', str(tmp_path / 'w.tif'), *cache, *options]
    done = CliRunner().invoke(app, command)
    assert done.exit_code == 2
    assert sentence in done.output
