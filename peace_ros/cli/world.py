# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""``peace world``: draw worlds, put them together from web-map tiles, look at them."""

from __future__ import annotations

from contextlib import closing
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.console import Console
from rich.progress import Progress

from peace_ros.cli.extras import require
from peace_ros.core.domain import ConfigurationError, Label

if TYPE_CHECKING:
    from peace_ros.simulation.tiles.mercator import GeoPlace
    from peace_ros.simulation.world import World

_LABEL_SUFFIX = '_label.png'
_PREVIEW_PX = 1200


def world_draw(
    out: Annotated[Path, typer.Option(metavar='FILE', help='.png or .jpg; labels go beside it.')],
    seed: Annotated[int, typer.Option(help='The same seed draws the same world.')] = 1,
    size: Annotated[float, typer.Option(metavar='M', help='Side of the square.')] = 400.0,
    gsd: Annotated[float, typer.Option(metavar='M', help='Metres of ground per pixel.')] = 0.1,
    district: Annotated[
        str, typer.Option(metavar='NAME', help='mixed, suburb, city_centre, campus, coast ...')
    ] = 'mixed',
    season: Annotated[str, typer.Option(metavar='NAME', help='Without: the seed chooses.')] = '',
    condition: Annotated[
        str, typer.Option(metavar='NAME', help='Weather, light or image quality.')
    ] = 'clear',
) -> None:
    """Draw a world with exact labels, for `peace demo --world` and `peace experiment --world`."""
    import numpy as np

    from peace_ros.recording.canvas import save_picture
    from peace_ros.simulation.drawing import apply_condition
    from peace_ros.simulation.world import draw_world

    with Console().status('drawing'):
        world = draw_world(seed, size, gsd, district, season)
        image = apply_condition(
            world.image_rgb, condition, np.random.default_rng(seed), labels=world.labels
        )
    out.parent.mkdir(parents=True, exist_ok=True)
    save_picture(image, out)
    if world.labels is not None:
        save_picture(world.labels, out.with_name(out.stem + _LABEL_SUFFIX))
    typer.echo(f'{out}: {size:g} m at {gsd:g} m per pixel, labels {out.stem}{_LABEL_SUFFIX}')


def world_tiles(
    out: Annotated[Path, typer.Option(metavar='FILE', help='GeoTIFF (.tif).')],
    url: Annotated[
        str,
        typer.Option(
            metavar='URL', help='With {z}, {x} and {y}, {-y} or {q}.', envvar='PEACE_TILES'
        ),
    ] = '',
    attribution: Annotated[
        str, typer.Option(metavar='TEXT', help='What the provider wants in each picture.')
    ] = '',
    at: Annotated[str, typer.Option(metavar='LAT,LON', help='Middle of the world.')] = '',
    preset: Annotated[
        str, typer.Option(metavar='NAME', help='paris: a start of the paper, by --seed.')
    ] = '',
    seed: Annotated[int, typer.Option(min=0, help='Of the place in a preset.')] = 1,
    size: Annotated[float, typer.Option(metavar='M', help='Side of the square.')] = 600.0,
    zoom: Annotated[int, typer.Option(min=1, max=23, help='Of the tiles.')] = 20,
    cache: Annotated[
        Path, typer.Option(metavar='FILE', help='MBTiles file that keeps the tiles.')
    ] = Path('tiles.mbtiles'),
    offline: Annotated[bool, typer.Option('--offline', help='From the cache only.')] = False,
    rate: Annotated[float, typer.Option(metavar='HZ', help='Requests per second.')] = 2.0,
) -> None:
    """Put a world together from web-map tiles; each tile is asked for once and then kept.

    See the terms of the provider before: many allow neither downloads nor other uses.
    """
    require('requests', 'rasterio')
    from peace_ros.simulation.tiles.cache import TileCache
    from peace_ros.simulation.tiles.mosaic import save_geotiff, world_from_tiles
    from peace_ros.simulation.tiles.source import TileServer, TileSource

    if not offline and not url:
        raise ConfigurationError('no --url of tiles: give one, or --offline to use the cache only')
    if out.suffix.lower() not in {'.tif', '.tiff'}:
        raise ConfigurationError(f'--out {out}: give a file that ends in .tif')
    place = _place(at, preset, seed)
    server = None if offline else TileServer(url, attribution, rate)
    with closing(TileCache(cache)) as kept, Progress(console=Console(stderr=True)) as progress:
        source, task = TileSource(kept, server), progress.add_task('tiles', total=None)
        world = world_from_tiles(
            source,
            place,
            size,
            zoom,
            lambda here, total: progress.update(task, completed=here, total=total),
        )
        provider = kept.metadata().get('attribution', attribution)
    out.parent.mkdir(parents=True, exist_ok=True)
    save_geotiff(world, place, zoom, provider, out)
    typer.echo(
        f'{out}: {size:g} m around {place.latitude_deg:.5f}, {place.longitude_deg:.5f} at '
        f'{world.gsd_m:.4f} m per pixel; {source.fetched} tiles fetched; {provider}'
    )


def world_info(
    world: Annotated[Path, typer.Argument(help='Orthophoto or MBTiles file.')],
    gsd: Annotated[float | None, typer.Option(metavar='M', help='Metres per pixel.')] = None,
) -> None:
    """Show size, resolution and how much of each label a world has, or what a cache holds."""
    import numpy as np

    if world.suffix.lower() == '.mbtiles':
        from peace_ros.simulation.tiles.cache import TileCache

        if not world.is_file():
            raise ConfigurationError(f'{world}: no such file')
        with closing(TileCache(world)) as kept:
            typer.echo(f'{world}: {kept.count()} tiles')
            for name, value in sorted(kept.metadata().items()):
                typer.echo(f'  {name}: {value}')
        return
    loaded = _loaded(world, gsd)
    east_m, north_m = loaded.size_m
    height, width = loaded.image_rgb.shape[:2]
    typer.echo(
        f'{world}: {width} x {height} px, {east_m:.1f} x {north_m:.1f} m, {loaded.gsd_m:.4f} m per '
        'pixel'
    )
    if loaded.labels is None:
        typer.echo('  no labels beside it: landings over it cannot be judged')
        return
    shares = np.bincount(loaded.labels.ravel(), minlength=len(Label)) / loaded.labels.size
    for label in Label:
        typer.echo(f'  {label.name.lower():<12} {100.0 * shares[label]:5.1f} %')


def world_preview(
    world: Annotated[Path, typer.Argument(help='Orthophoto.')],
    out: Annotated[Path, typer.Option(metavar='FILE', help='.png or .jpg.')],
    gsd: Annotated[float | None, typer.Option(metavar='M', help='Metres per pixel.')] = None,
) -> None:
    """Write a small picture of a world; where it has labels, unsafe ground is red."""
    import cv2
    import numpy as np

    from peace_ros.core.domain import is_safe
    from peace_ros.recording.canvas import save_picture

    loaded = _loaded(world, gsd)
    height, width = loaded.image_rgb.shape[:2]
    scale = min(1.0, _PREVIEW_PX / max(height, width))
    size = (max(1, round(width * scale)), max(1, round(height * scale)))
    picture = np.asarray(cv2.resize(loaded.image_rgb, size, interpolation=cv2.INTER_AREA), np.uint8)
    if loaded.labels is not None:
        labels = cv2.resize(loaded.labels, size, interpolation=cv2.INTER_NEAREST)
        unsafe = (labels != Label.UNLABELED) & ~is_safe(np.asarray(labels, np.uint8))
        red = np.array([200, 30, 30], np.float32)
        picture[unsafe] = (0.65 * picture[unsafe] + 0.35 * red).astype(np.uint8)
    save_picture(picture, out)
    typer.echo(f'{out}: {size[0]} x {size[1]} px')


def _loaded(path: Path, gsd_m: float | None) -> World:
    from peace_ros.simulation.world import load_world

    beside = path.with_name(path.stem + _LABEL_SUFFIX)
    return load_world(path, gsd_m, beside if beside.is_file() else None)


def _place(at: str, preset: str, seed: int) -> GeoPlace:
    from peace_ros.simulation.tiles.mercator import GeoPlace
    from peace_ros.simulation.tiles.mosaic import PRESETS, place_in

    if bool(at) == bool(preset):
        raise ConfigurationError('give either --at LAT,LON or --preset paris')
    if preset:
        if preset not in PRESETS:
            raise ConfigurationError(f'--preset {preset}: choose one of {", ".join(PRESETS)}')
        return place_in(PRESETS[preset], seed)
    try:
        latitude, longitude = (float(each) for each in at.split(','))
    except ValueError as error:
        raise ConfigurationError(f'--at {at}: give latitude,longitude, as 48.858,2.294') from error
    return GeoPlace(latitude, longitude)
