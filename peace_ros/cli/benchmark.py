# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""``peace benchmark``."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any

import typer

from peace_ros.cli.extras import require
from peace_ros.core.domain import ConfigurationError
from peace_ros.core.inference import Bundle
from peace_ros.core.inference.providers import CPU, available_providers, check_providers
from peace_ros.lab.benchmark.bundles import NAMES, SEGMENTS, missing_bundles, random_bundles
from peace_ros.lab.benchmark.measure import Measured
from peace_ros.lab.benchmark.report import (
    clipseg_figures,
    describe_machine,
    fastsam_figures,
    markdown,
)
from peace_ros.lab.benchmark.scene import TERMS_13
from peace_ros.lab.benchmark.sweep import sweep as run_sweep
from peace_ros.lab.benchmark.sweep import sweep_table
from peace_ros.lab.benchmark.worker import run_apart
from peace_ros.recording.run_folder import write_whole

_CACHE = '~/.cache/peace_ros/benchmark'
_RANDOM = 'random'
_EXPORT = ('torch', 'transformers', 'onnx')
_QUICK_CALLS = 8
"""Of one CLIP call per segment, those that are made with --quick; all take the same."""


def benchmark(
    *,
    reference: Annotated[
        bool,
        typer.Option('--reference', help='Also time the reference path (export extra).'),
    ] = False,
    quick: Annotated[
        bool, typer.Option('--quick', help='Fewer frames; within 4 minutes on two cores.')
    ] = False,
    json_file: Annotated[
        Path | None, typer.Option('--json', metavar='FILE', help='Write the figures here.')
    ] = None,
    table: Annotated[
        Path, typer.Option(metavar='FILE', help='Write the Markdown table here.')
    ] = Path('benchmark.md'),
    clipseg: Annotated[
        str, typer.Option(metavar='BUNDLE', help='CLIPSeg to time; none: random, true size.')
    ] = '',
    clip: Annotated[
        str, typer.Option(metavar='BUNDLE', help='CLIP that ranks words; none: random ViT-B/32.')
    ] = '',
    source: Annotated[
        str, typer.Option(help='What --clipseg was exported from, for the reference.')
    ] = _RANDOM,
    clip_source: Annotated[
        str, typer.Option(help='The CLIP that ranks in the reference; none: random ViT-L/14.')
    ] = _RANDOM,
    provider: Annotated[
        str, typer.Option(help='Execution provider; none: the first of OpenVINO and CPU.')
    ] = '',
    threads: Annotated[int, typer.Option(min=1, max=64, help='CPU threads.')] = 2,
    work: Annotated[
        Path, typer.Option(metavar='DIR', help='Where random bundles are kept.')
    ] = Path(_CACHE),
    fastsam: Annotated[
        bool, typer.Option(help='Time FastSAM-s too, with random weights and 50 known segments.')
    ] = True,
    sweep: Annotated[
        bool,
        typer.Option(
            '--sweep',
            help="Only time CLIPSeg's networks over threads, precisions, providers and graph "
            'optimisations, in fp32 and int8.',
        ),
    ] = False,
) -> None:
    """Time CLIPSeg and FastSAM frame by frame, compared with the ways that others run them."""
    provider = provider or _fastest()
    check_providers((provider,))
    if reference:
        require(*_EXPORT)
    if reference and bool(clipseg) != (source != _RANDOM):
        raise ConfigurationError(
            f'--clipseg {clipseg or "(random)"} with --source {source}: the reference must have '
            'the same weights; give both or neither'
        )
    for bundle in filter(None, (clipseg, clip)):
        Bundle.load(bundle)  # refused now, not after minutes in a process of its own
    if sweep:
        _sweep(clipseg, work, threads, table, json_file)
        return
    needed = [name for name in NAMES if fastsam or not name.startswith('fastsam')]
    random = _random(work, needed) if fastsam or not (clipseg and clip) else {}
    clipseg = clipseg or str(random['clipseg-rd64-int8'])
    fp32 = str(random['clipseg-rd64-fp32']) if 'int8' in clipseg and random else clipseg
    clip = clip or str(random['clip-vit-b-32-int8'])
    conditions = describe_machine(threads, len(TERMS_13))
    frames = 30 if quick else 60
    setup = {'bundle': clipseg, 'clip': clip, 'threads': threads}
    typer.echo(f'{conditions}\ntiming peace_ros on {provider} ...')
    ours = _measure('ours:measure_ours', **setup, provider=provider, frames=frames)
    plain = {**setup, 'bundle': fp32, 'provider': CPU}
    typer.echo('measuring the memory of fp32 ...')
    memory = _measure('ours:measure_memory', **plain, frames=3)
    typer.echo("timing BlabberSeg's way ...")
    blabberseg = _measure('ours:measure_blabberseg', **plain, frames=5 if quick else 15)
    slow = None
    if reference:
        typer.echo('timing the reference path ...')
        slow = _measure(
            'reference:measure_clipseg',
            source=source,
            clip_source=clip_source,
            tokenizer_bundle=clipseg,
            threads=threads,
            count=2 if quick else 5,
        )
    figures = clipseg_figures(ours, memory, slow, blabberseg)
    ways = [way for way in (ours, blabberseg, slow) if way is not None]
    text = markdown(ways, figures, conditions)
    found: dict[str, Any] = {'clipseg': figures, 'conditions': conditions}
    if fastsam:
        setup = {'bundle': str(random['fastsam-s-fp32']), 'threads': threads}
        measured = _measure_fastsam(setup, clip, provider, quick=quick, with_reference=reference)
        found['fastsam'] = fastsam_figures(*measured)
        ways = [way for way in measured if way is not None]
        text += '\n' + markdown(ways, found['fastsam'], 'FastSAM-s, 50 segments, 13 terms.')
    _write(text, found, table, json_file)


def _random(work: Path, names: Sequence[str]) -> dict[str, Path]:
    """Return the random bundles; only what is not there yet takes the ``export`` extra."""
    if missing_bundles(work, names):
        require(*_EXPORT)
    return random_bundles(work, typer.echo, names)


def _sweep(clipseg: str, work: Path, threads: int, table: Path, json_file: Path | None) -> None:
    if clipseg:
        bundles = {Bundle.load(clipseg).manifest.precision: clipseg}
    else:
        names = {each: f'clipseg-rd64-{each}' for each in ('fp32', 'int8')}
        made = _random(work, tuple(names.values()))
        bundles = {precision: str(made[name]) for precision, name in names.items()}
    conditions = describe_machine(threads, len(TERMS_13))
    rows = run_sweep(bundles, threads, typer.echo)
    found = {'sweep': rows, 'sweep_conditions': conditions}
    _write(sweep_table(rows, conditions), found, table, json_file)


def _measure_fastsam(
    setup: dict[str, Any], clip: str, provider: str, *, quick: bool, with_reference: bool
) -> tuple[Measured, Measured | None, Measured | None]:
    """Return what ours took, the reference, and the reference without texts."""
    typer.echo('timing FastSAM ...')
    how_long = {'frames': 8, 'parts': 3} if quick else {'frames': 20, 'parts': 5}
    ours = _measure('ours:measure_ours', **setup, clip=clip, provider=provider, **how_long)
    if not with_reference:
        return ours, None, None
    typer.echo('timing one CLIP call per segment ...')
    slow, images = (
        _measure(
            'reference:measure_fastsam',
            **setup,
            count=2,
            calls=_QUICK_CALLS if quick else SEGMENTS,
            with_texts=with_texts,
        )
        for with_texts in (True, False)
    )
    return ours, slow, images


def _fastest() -> str:
    available = available_providers()
    return next(each for each in ('OpenVINOExecutionProvider', CPU) if each in available)


def _measure(name: str, **arguments: Any) -> Measured:
    measured: Measured = run_apart(f'peace_ros.lab.benchmark.{name}', **arguments)
    return measured


def _write(text: str, figures: dict[str, Any], table: Path, json_file: Path | None) -> None:
    typer.echo(text)
    write_whole(table, text, 'table')
    if json_file is not None:
        # What was not measured this time stays.
        kept = json.loads(json_file.read_text(encoding='utf-8')) if json_file.is_file() else {}
        write_whole(json_file, json.dumps({**kept, **figures}, indent=2) + '\n', 'figures')
