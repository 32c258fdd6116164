# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""``peace``: the command line for people.

A verb is a function in a module of its own, and imported when it is called: its options stand
beside what it needs, and ``peace --help`` is quick.
"""

from __future__ import annotations

import importlib
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Annotated

import typer

from peace_ros import __version__
from peace_ros.cli.extras import how_to_install
from peace_ros.cli.options import for_typer
from peace_ros.core.domain import (
    BundleError,
    ConfigurationError,
    PeaceError,
    RecordingError,
    WorldError,
)

EXIT_FAILED, EXIT_REFUSED, EXIT_INTERRUPTED = 1, 2, 130

VERBS = {
    'doctor': 'Check ROS, models, camera, autopilot and computer before a flight.',
    'demo': 'Fly a simulated vehicle from 100 m to 20 m over a place that the nodes choose.',
    'watch': 'Show a landing on a local web page.',
    'replay': 'Run prompts, segmentation and landing over a recording.',
    'benchmark': 'Time CLIPSeg and FastSAM per frame, beside the ways that others run them.',
    'faults': 'Put every fault into a flight of the real processes, and judge what happens.',
    'evaluate': 'Measure on labelled images how safe it is what the heatmaps call safe.',
    'ablate': 'Measure what vocabularies, templates, words, fusion and thresholds are worth.',
    'experiment': 'Fly many landings in simulated time and judge each by ground truth.',
    'report': 'Make a page of an experiment: tables, charts, failures with pictures.',
    'words': 'Measure how often CLIP names the weather, light or look of a frame.',
}
"""Verb -> its line in the help. The function of that name in the module of that name runs it."""
MODEL_VERBS = {
    'list': 'List the bundles that ship with the package, and your own.',
    'info': "Show a bundle's manifest.",
    'warm': 'Run a frame through the networks, so that what a provider builds is there.',
    'verify': 'Check the files of a bundle against the checksums of its manifest.',
    'export': 'Export CLIP, CLIPSeg or FastSAM, verify it against its reference, put it in place.',
    'fetch': 'Fetch a named bundle, checked and resumable.',
}
"""The same for ``peace models``; ``models_<verb>`` in the module ``models`` runs it."""
WORLD_VERBS = {
    'draw': 'Draw a world with exact labels.',
    'tiles': 'Put a world together from web-map tiles.',
    'info': 'Show size, resolution and labels of a world, or what a cache of tiles holds.',
    'preview': 'Write a small picture of a world.',
}
"""The same for ``peace world``."""

app = typer.Typer(
    name='peace',
    help='Find a place below a drone where landing hurts nobody, and go there.',
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
)
models_app = typer.Typer(help='Look at model bundles, make them, fetch them.', no_args_is_help=True)
app.add_typer(models_app, name='models')
world_app = typer.Typer(help='Draw worlds, fetch them, look at them.', no_args_is_help=True)
app.add_typer(world_app, name='world')

_HANDED_ON = {
    'allow_extra_args': True,
    'ignore_unknown_options': True,
    'help_option_names': [],
}


def _add(to: typer.Typer, name: str, summary: str, module: str, function: str) -> None:

    def run(context: typer.Context) -> None:
        with _in_one_sentence():
            verb = getattr(importlib.import_module(f'peace_ros.cli.{module}'), function)
            own = typer.Typer(add_completion=False, pretty_exceptions_enable=False)
            own.command()(for_typer(verb))
            status = own(args=context.args, prog_name=context.command_path, standalone_mode=False)
            if isinstance(status, int) and status:
                raise typer.Exit(status)

    to.command(name, help=summary, context_settings=_HANDED_ON)(run)


@contextmanager
def _in_one_sentence() -> Iterator[None]:
    """Turn an error into one sentence on standard error and an exit status.

    2 for what the user gave and can change, 1 for what failed on the way. A defect keeps its
    traceback.
    """
    try:
        yield
    except PeaceError as error:
        typer.echo(f'peace: {error}', err=True)
        refused = (ConfigurationError, BundleError, RecordingError, WorldError)
        status = EXIT_REFUSED if isinstance(error, refused) else EXIT_FAILED
        raise typer.Exit(status) from None
    except ModuleNotFoundError as error:
        if (sentence := how_to_install(error)) is None:
            raise
        typer.echo(f'peace: {sentence}', err=True)
        raise typer.Exit(EXIT_REFUSED) from None
    except KeyboardInterrupt:
        typer.echo('peace: interrupted', err=True)
        raise typer.Exit(EXIT_INTERRUPTED) from None


for _name, _summary in VERBS.items():
    _add(app, _name, _summary, _name, _name)
for _name, _summary in MODEL_VERBS.items():
    _add(models_app, _name, _summary, 'models', f'models_{_name}')
for _name, _summary in WORLD_VERBS.items():
    _add(world_app, _name, _summary, 'world', f'world_{_name}')


def _show_version(wanted: bool) -> None:
    if wanted:
        typer.echo(f'peace_ros {__version__}')
        raise typer.Exit


@app.callback()
@for_typer
def root(
    _version: Annotated[
        bool,
        typer.Option(
            '--version', callback=_show_version, is_eager=True, help='Show the version and exit.'
        ),
    ] = False,
) -> None:
    """Find a place below a drone where landing hurts nobody, and go there."""


def main() -> None:
    """Run the command line."""
    app()


if __name__ == '__main__':
    main()
