# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""``peace``: the command line for people."""

from __future__ import annotations

from collections.abc import Callable
from functools import wraps
from pathlib import Path
from typing import Annotated, Any, TypeVar

import typer

from peace_ros import __version__
from peace_ros.domain import ConfigurationError, PeaceError

EXIT_FAILED, EXIT_REFUSED, EXIT_INTERRUPTED = 1, 2, 130

app = typer.Typer(
    name='peace',
    help='Find a place below a drone where landing hurts nobody, and go there.',
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
)
models_app = typer.Typer(help='Look at model bundles.', no_args_is_help=True)
app.add_typer(models_app, name='models')

_Verb = TypeVar('_Verb', bound=Callable[..., Any])


def _in_one_sentence(verb: _Verb) -> _Verb:
    """Turn a PeaceError into one sentence on standard error and an exit status.

    2 for what the user gave and can change, 1 for what failed on the way.
    """

    @wraps(verb)
    def run(*arguments: Any, **options: Any) -> Any:
        try:
            return verb(*arguments, **options)
        except PeaceError as error:
            typer.echo(f'peace: {error}', err=True)
            raise typer.Exit(_status_of(error)) from None
        except KeyboardInterrupt:
            typer.echo('peace: interrupted', err=True)
            raise typer.Exit(EXIT_INTERRUPTED) from None

    return run  # type: ignore[return-value]


_HANDED_ON = {
    'allow_extra_args': True,
    'ignore_unknown_options': True,
    'help_option_names': [],
}
"""Settings of a verb whose options are declared beside code that is slow to import."""


def _hand_on(verb: Callable[..., Any], context: typer.Context) -> None:
    """Let a verb read its own options from what is left of the command line."""
    own = typer.Typer(add_completion=False, pretty_exceptions_enable=False)
    own.command()(verb)
    status = own(args=context.args, prog_name=context.command_path, standalone_mode=False)
    if isinstance(status, int) and status:
        raise typer.Exit(status)


def _status_of(error: PeaceError) -> int:
    from peace_ros.domain import BundleError, RecordingError, WorldError

    refused = (ConfigurationError, BundleError, RecordingError, WorldError)
    return EXIT_REFUSED if isinstance(error, refused) else EXIT_FAILED


def _show_version(wanted: bool) -> None:
    if wanted:
        typer.echo(f'peace_ros {__version__}')
        raise typer.Exit


@app.callback()
def root(
    _version: Annotated[
        bool,
        typer.Option(
            '--version', callback=_show_version, is_eager=True, help='Show the version and exit.'
        ),
    ] = False,
) -> None:
    """Find a place below a drone where landing hurts nobody, and go there."""


@app.command()
@_in_one_sentence
def demo(
    *,
    world: Annotated[
        Path | None,
        typer.Option(help='Orthophoto (JPEG, PNG, GeoTIFF); without it a world is drawn.'),
    ] = None,
    gsd: Annotated[
        float | None,
        typer.Option(metavar='M', help='Metres of ground per pixel of --world.'),
    ] = None,
    labels: Annotated[
        Path | None,
        typer.Option(
            help='Label raster of --world; <name>_label.png beside it is found by itself.'
        ),
    ] = None,
    start: Annotated[
        str | None,
        typer.Option(
            metavar='X,Y', help='Start, metres east and north of the centre; default by --seed.'
        ),
    ] = None,
    config: Annotated[
        str, typer.Option(metavar='PRESET', help='Preset: dd_cs, d_cs, peace_cs, or a file.')
    ] = 'peace_cs',
    speed: Annotated[
        float | None,
        typer.Option(help='Simulated seconds per second; default: 2 if this machine keeps up.'),
    ] = None,
    seed: Annotated[int, typer.Option(help='Seed of the drawn world and of the start.')] = 1,
    autopilot: Annotated[
        str | None,
        typer.Option(metavar='KIND', help='What is simulated: ardupilot (default) or px4.'),
    ] = None,
    mavlink: Annotated[
        str | None,
        typer.Option(metavar='URL', help='An autopilot that is already there.'),
    ] = None,
    pose_mavlink: Annotated[
        str | None,
        typer.Option(metavar='URL', help='A second connection to it, which the camera follows.'),
    ] = None,
    camera_px: Annotated[
        int,
        typer.Option(
            metavar='N',
            help='Side of the image; from 704 on it is also seen closer, in parts; takes time.',
        ),
    ] = 352,
    run_dir: Annotated[
        Path | None,
        typer.Option(metavar='DIR', help='Empty or new folder; default runs/<time>-seed<seed>.'),
    ] = None,
    timeout: Annotated[
        float, typer.Option(metavar='S', help='Seconds that the landing may take.')
    ] = 330.0,
) -> None:
    """Fly a simulated vehicle from 100 m to 20 m over a place that the nodes choose by camera.

    Exit status 0 only when it ended over a place that the ground truth does not call unsafe.
    """
    from rich.console import Console

    from peace_ros.demo.options import DemoOptions, parse_start
    from peace_ros.demo.run import run_demo

    options = DemoOptions(
        world=world,
        gsd_m=gsd,
        labels=labels,
        start=None if start is None else parse_start(start),
        config=config,
        speed=speed,
        seed=seed,
        autopilot=autopilot,
        mavlink=mavlink,
        pose_mavlink=pose_mavlink,
        camera_px=camera_px,
        run_dir=run_dir,
        timeout_s=timeout,
    )
    raise typer.Exit(run_demo(options, Console()))


@app.command()
@_in_one_sentence
def replay(
    *,
    source: Annotated[Path, typer.Argument(help='Bag (folder, .mcap, .db3) or video file.')],
    image_topic: Annotated[
        str | None,
        typer.Option(help='Image or CompressedImage; default: the only one, or /image.'),
    ] = None,
    pose_topic: Annotated[
        str | None,
        typer.Option(help='PoseStamped, PoseWithCovarianceStamped or Odometry, in ENU.'),
    ] = None,
    config: Annotated[str, typer.Option(metavar='PRESET', help='Preset or file.')] = 'peace_cs',
    out: Annotated[
        Path | None,
        typer.Option(metavar='DIR', help='Empty or new folder; default runs/<source>_replay.'),
    ] = None,
    fov: Annotated[
        float | None,
        typer.Option(
            metavar='DEG', help='Full horizontal field of view; default camera_info, else 73.'
        ),
    ] = None,
    altitude: Annotated[
        str, typer.Option(metavar='START:END', help='Metres, linear over the file; for videos.')
    ] = '100:20',
    every: Annotated[int, typer.Option(metavar='N', help='Take every N-th frame.')] = 1,
    hz: Annotated[
        float | None,
        typer.Option(metavar='HZ', help='Take at most HZ frames per recorded second.'),
    ] = None,
    limit: Annotated[
        int | None,
        typer.Option(metavar='N', help='Stop after N frames.'),
    ] = None,
) -> None:
    """Run prompts, segmentation and landing over a recording; the vehicle cannot be moved."""
    from rich.console import Console

    from peace_ros.replay import ReplayOptions, SourceOptions
    from peace_ros.replay.console import replay_in_terminal

    part = SourceOptions(
        image_topic=image_topic,
        pose_topic=pose_topic,
        fov_x_deg=fov,
        altitude=altitude,
        every=every,
        hz=hz,
        limit=limit,
    )
    replay_in_terminal(ReplayOptions(source, config, out, part), Console())


@app.command(context_settings=_HANDED_ON)
@_in_one_sentence
def benchmark(context: typer.Context) -> None:
    """Time CLIPSeg and FastSAM frame by frame, beside the ways that others run them."""
    from peace_ros.evaluation.benchmark import command

    _hand_on(command.benchmark, context)


@app.command(context_settings=_HANDED_ON)
@_in_one_sentence
def faults(context: typer.Context) -> None:
    """Put every fault into a flight of the real processes and judge what happens."""
    from peace_ros.faults import command

    _hand_on(command.faults, context)


@app.command(context_settings=_HANDED_ON)
@_in_one_sentence
def evaluate(context: typer.Context) -> None:
    """Measure on labelled images how safe what the heatmaps call safe is."""
    from peace_ros.evaluation.segmentation import command

    _hand_on(command.evaluate, context)


@app.command(context_settings=_HANDED_ON)
@_in_one_sentence
def ablate(context: typer.Context) -> None:
    """Measure what vocabularies, templates, words, fusion and thresholds are worth."""
    from peace_ros.evaluation.ablation import command

    _hand_on(command.ablate, context)


@app.command(context_settings=_HANDED_ON)
@_in_one_sentence
def words(context: typer.Context) -> None:
    """Measure how often CLIP names the weather, light or look of a frame."""
    from peace_ros.evaluation import words as command

    _hand_on(command.words, context)


@models_app.command(context_settings=_HANDED_ON)
@_in_one_sentence
def export(context: typer.Context) -> None:
    """Export CLIP, CLIPSeg or FastSAM, verify it against its reference, put it in place."""
    from peace_ros.inference.export import commands

    _hand_on(commands.export, context)


@models_app.command(context_settings=_HANDED_ON)
@_in_one_sentence
def fetch(context: typer.Context) -> None:
    """Fetch a named bundle, checked and resumable."""
    from peace_ros.inference.export import commands

    _hand_on(commands.fetch, context)


@models_app.command('list')
@_in_one_sentence
def models_list() -> None:
    """List the bundles that ship with the package, and your own."""
    from peace_ros.domain import BundleError
    from peace_ros.inference.bundle import MANIFEST_NAME, user_models_dir
    from peace_ros.inference.manifest import parse_manifest
    from peace_ros.resources import models_dir

    for place in dict.fromkeys((models_dir(), user_models_dir())):
        # What is under way or set aside begins with a dot.
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


@models_app.command('info')
@_in_one_sentence
def models_info(name: Annotated[str, typer.Argument(help='Name or folder.')]) -> None:
    """Show what a bundle's manifest says."""
    from peace_ros.inference import Bundle

    bundle = Bundle.load(name)
    typer.echo((bundle.folder / 'manifest.json').read_text(encoding='utf-8').rstrip())


@models_app.command('verify')
@_in_one_sentence
def models_verify(name: Annotated[str, typer.Argument(help='Name or folder.')]) -> None:
    """Check every file of a bundle against the checksums of its manifest."""
    from peace_ros.inference import Bundle

    bundle = Bundle.load(name)
    typer.echo(f'{bundle.manifest.name}: {len(bundle.manifest.files)} files are whole')
    if bundle.manifest.verification:
        typer.echo('agreement with the reference when it was exported:')
    for figure, value in bundle.manifest.verification.items():
        typer.echo(f'  {figure:<12} {value:g}')


def main() -> None:
    """Run the command line."""
    app()


if __name__ == '__main__':
    main()
