# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""``peace models``: list, check, export and download bundles."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer
from rich.progress import BarColumn, DownloadColumn, Progress, TaskID, TimeRemainingColumn

from peace_ros.cli.extras import require
from peace_ros.core.domain import ConfigurationError
from peace_ros.core.inference.bundle import user_models_dir
from peace_ros.core.inference.manifest import PRECISIONS
from peace_ros.core.presets import DEFAULT_PRESET

_INDEX = 'PEACE_MODELS_INDEX'
_NEEDED = ('torch', 'transformers', 'onnx')


def models_list() -> None:
    """List the bundles that ship with the package, and your own."""
    from peace_ros.core.domain import BundleError
    from peace_ros.core.inference.bundle import MANIFEST_NAME, user_models_dir
    from peace_ros.core.inference.manifest import parse_manifest
    from peace_ros.core.resources import models_dir

    for place in dict.fromkeys((models_dir(), user_models_dir())):
        # Names of unfinished and replaced bundles begin with a dot.
        for path in sorted(place.glob(f'[!.]*/{MANIFEST_NAME}')):
            try:
                manifest = parse_manifest(path.read_bytes(), str(path))
            except BundleError as error:
                typer.echo(f'{path.parent.name}  cannot be used: {error}')
                continue
            size_mb = sum(entry.bytes for entry in manifest.files.values()) / 1e6
            typer.echo(
                f'{path.parent.name}  {manifest.family}  {manifest.precision}  {size_mb:.1f} MB'
            )


def models_info(name: Annotated[str, typer.Argument(help='Name or folder.')]) -> None:
    """Show what a bundle's manifest says."""
    from peace_ros.core.inference import Bundle

    bundle = Bundle.load(name)
    typer.echo((bundle.folder / 'manifest.json').read_text(encoding='utf-8').rstrip())


def models_verify(name: Annotated[str, typer.Argument(help='Name or folder.')]) -> None:
    """Check every file of a bundle against the checksums of its manifest."""
    from peace_ros.core.inference import Bundle

    bundle = Bundle.load(name)
    typer.echo(f'{bundle.manifest.name}: {len(bundle.manifest.files)} files are whole')
    if bundle.manifest.verification:
        typer.echo('agreement with the reference when it was exported:')
    for figure, value in bundle.manifest.verification.items():
        typer.echo(f'  {figure:<12} {value:g}')


def models_warm(
    *,
    config: Annotated[
        str, typer.Option(metavar='PRESET', help='Preset or parameter file of the nodes.')
    ] = DEFAULT_PRESET,
    provider: Annotated[
        list[str] | None,
        typer.Option(help='Execution providers in place of those of the preset, in order.'),
    ] = None,
    size: Annotated[
        str, typer.Option(metavar='WxH', help="Pixels of a frame; none: the preset's camera.")
    ] = '',
) -> None:
    """Load the networks of a preset and run frames through them.

    What a provider builds and keeps, such as the engines of TensorRT, is then there when the nodes
    start. Their heatmaps are compared with those of ONNX Runtime on the CPU. Exit status 1 when
    something must be mended.
    """
    from peace_ros.core.node_parameters import CameraOptions
    from peace_ros.core.presets import load_preset
    from peace_ros.lab.doctor.finding import CheckResult
    from peace_ros.lab.doctor.models import Models

    preset = load_preset(config)
    camera = preset.fill('landing', CameraOptions)
    width_px, height_px = _size(size) if size else (camera.camera_width, camera.camera_height)
    models = Models(preset, provider or (), builds_engines=True)
    failed = False
    for check in (
        models.load,
        lambda: models.time_frame(width_px, height_px),
        lambda: models.compare(width_px, height_px),
    ):
        for each in check():
            typer.echo(f'{each.found}: {each.remedy}' if each.remedy else each.found)
            failed |= each.outcome is CheckResult.MEND
    if failed:
        raise typer.Exit(1)


def _size(text: str) -> tuple[int, int]:
    """Return width and height of ``640x480``; ConfigurationError for anything else."""
    parts = text.split('x')
    if len(parts) != 2 or not all(each.isdecimal() and 16 <= int(each) <= 8192 for each in parts):
        raise ConfigurationError(f'--size {text!r}: give width x height, 16 to 8192: 640x480')
    return int(parts[0]), int(parts[1])


def models_export(
    source: Annotated[
        str,
        typer.Argument(
            help='Hugging Face id (CIDAS/clipseg-rd64-refined, openai/clip-vit-base-patch32), '
            'local folder, OpenAI/OpenCLIP checkpoint; with --clip FastSAM-s.pt or -x.pt, or the '
            '.onnx of one. Reading a .pt of FastSAM runs code that the file may hold: take it '
            'from a source that you trust.'
        ),
    ],
    *,
    name: Annotated[str, typer.Option(help='Name of the bundle; none: made of the source.')] = '',
    out: Annotated[
        Path | None, typer.Option(metavar='DIR', help="Folder of bundles; none: the user's own.")
    ] = None,
    precision: Annotated[str, typer.Option(help='fp32, fp16 (GPU) or int8 (CPU).')] = 'fp32',
    images: Annotated[
        Path | None,
        typer.Option(metavar='DIR', help='Nadir photos to calibrate and verify on.'),
    ] = None,
    licence: Annotated[str, typer.Option(help='Licence of the weights.')] = 'that of the source',
    clip: Annotated[
        str, typer.Option(metavar='BUNDLE', help='FastSAM: the CLIP bundle that scores segments.')
    ] = '',
    side: Annotated[
        int, typer.Option(metavar='PX', help='FastSAM: side of its input; 0: its own, else 640.')
    ] = 0,
) -> None:
    """Export CLIP, CLIPSeg or FastSAM, verify it against its reference, put it in place."""
    if precision not in PRECISIONS:  # before gigabytes are loaded
        raise ConfigurationError(f'precision {precision!r}: choose one of {", ".join(PRECISIONS)}')
    if name and Path(name).name != name:
        raise ConfigurationError(f'--name {name}: give a name; --out says in which folder it goes')
    if clip:
        _export_fastsam(Path(source), clip, out, name, precision, images, side)
        return
    if side or Path(source).suffix == '.onnx' or 'fastsam' in Path(source).name.lower():
        raise ConfigurationError(
            f'{source}: FastSAM needs a CLIP to score its segments: export one and name its '
            'bundle, --clip BUNDLE'
        )
    require(*_NEEDED)
    from peace_ros.lab.export.build import build_bundle
    from peace_ros.lab.export.pictures import read_pictures
    from peace_ros.lab.export.sources import load_source

    frames = read_pictures(images) if images else None
    loaded = load_source(source)
    folder = (out or user_models_dir()) / (name or f'{loaded.name}-{precision}')
    typer.echo(f'exporting {source} ({loaded.family}) in {precision} ...')
    agreement = build_bundle(loaded, folder, precision=precision, frames=frames, licence=licence)
    typer.echo(f'{folder}: agrees with its reference: {agreement}')
    if frames is None:
        typer.echo("(checked on drawn scenes; give --images DIR with photos like a flight's)")


def _export_fastsam(
    source: Path,
    clip: str,
    out: Path | None,
    name: str,
    precision: str,
    images: Path | None,
    side_px: int,
) -> None:
    require(*(('onnx',) if source.suffix == '.onnx' else ('onnx', 'torch')))
    from peace_ros.core.inference.bundle import Bundle
    from peace_ros.lab.export.fastsam import export_fastsam
    from peace_ros.lab.export.pictures import read_pictures

    folder = (out or user_models_dir()) / (name or f'{source.stem}-{precision}')
    typer.echo(f'exporting {source} (fastsam) in {precision}, scored by {clip} ...')
    agreement = export_fastsam(
        source.expanduser(),
        Bundle.load(clip),
        folder,
        side_px=side_px,
        precision=precision,
        frames=read_pictures(images) if images else None,
    )
    typer.echo(f'{folder}: agrees with its reference: {agreement}')


def models_fetch(
    name: Annotated[str, typer.Argument(help='Name of the bundle in the index.')],
    *,
    index: Annotated[
        str, typer.Option(envvar=_INDEX, help='URL or file of the index of bundles.')
    ] = '',
    out: Annotated[
        Path | None, typer.Option(metavar='DIR', help="Folder of bundles; none: the user's own.")
    ] = None,
) -> None:
    """Download a bundle by name; an interrupted download continues where it stopped."""
    from peace_ros.lab.export.fetch import fetch_bundle

    if not index:
        raise ConfigurationError(
            f'no index of bundles: give --index or set {_INDEX}; to make a bundle yourself use '
            'peace models export'
        )
    folder = (out or user_models_dir()) / name
    columns = ('{task.description}', BarColumn(), DownloadColumn(), TimeRemainingColumn())
    with Progress(*columns) as bar:
        tasks: dict[str, TaskID] = {}

        def show(file: str, have: int, size: int) -> None:
            if file not in tasks:
                tasks[file] = bar.add_task(file, total=size)
            bar.update(tasks[file], completed=have)

        bundle = fetch_bundle(name, index, folder, show)
    typer.echo(f'{bundle.folder}: {bundle.manifest.family}, {bundle.manifest.precision}')
