# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""``peace evaluate``."""

from __future__ import annotations

import json
from dataclasses import asdict
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.console import Console

from peace_ros.cli import image_options as options
from peace_ros.core.segmentation import FUSIONS
from peace_ros.lab.evaluation.segmentation.cores import Cores, Overrides, build_cores
from peace_ros.lab.evaluation.segmentation.errors import DatasetError
from peace_ros.lab.evaluation.segmentation.figures import Figures, figures_of, together
from peace_ros.lab.evaluation.segmentation.inputs import EvaluationInputs, open_source
from peace_ros.lab.evaluation.segmentation.progress import over_images
from peace_ros.lab.evaluation.segmentation.run import Outcome
from peace_ros.lab.evaluation.segmentation.run import evaluate as run_evaluation
from peace_ros.lab.evaluation.segmentation.samples import CAMERA_PX, SampleSource
from peace_ros.lab.evaluation.segmentation.table import figures_table, remarks_of
from peace_ros.lab.evaluation.segmentation.threshold import (
    RiskBudget,
    choose_threshold,
    save_threshold,
)
from peace_ros.lab.evaluation.segmentation.tiles import WHOLE

DEFAULT_CONFIG = 'peace_cs'
ALL_CONFIGS = ('dd_cs', 'd_cs', 'peace_cs', 'dd_fs', 'd_fs', 'peace_fs')


def evaluate(
    *,
    more_configs: Annotated[
        list[str] | None, typer.Argument(metavar='CONFIG', help='Like --config.')
    ] = None,
    config: Annotated[
        list[str] | None,
        typer.Option(
            metavar='PRESET',
            help=f'Preset or file, several allowed; all: {", ".join(ALL_CONFIGS)}.',
        ),
    ] = None,
    dataset: options.DatasetName = '',
    root: options.Root = None,
    images: options.Images = None,
    labels: options.Labels = None,
    manifest: options.Manifest = None,
    drawn: options.Drawn = 0,
    drawn_seed: options.DrawnSeed = None,
    drawn_px: options.DrawnPx = CAMERA_PX,
    classes: options.ClassTable = 'common',
    split: options.Split = '',
    mixed: options.Mixed = 'ignore',
    limit: options.Limit = None,
    tile_px: options.TilePx = None,
    whole: options.Whole = False,
    max_looks: options.MaxLooks = 0,
    threshold: Annotated[
        float | None,
        typer.Option(metavar='SCORE', help="The network's score; default: the bundle's own."),
    ] = None,
    fusion: Annotated[
        str, typer.Option(help=f'In place of the presets: {", ".join(FUSIONS)}.')
    ] = '',
    terms: options.TermsFile = '',
    clip: options.ClipBundle = '',
    clipseg: options.ClipSegBundle = '',
    fastsam: Annotated[str, typer.Option(metavar='BUNDLE', help='FastSAM of *_fs.')] = '',
    threads: options.Threads = 2,
    no_terms: Annotated[
        bool, typer.Option('--no-terms', help='Do not score each term by itself.')
    ] = False,
    strict: options.Strict = False,
    max_false_safe: Annotated[
        float | None,
        typer.Option(metavar='SHARE', min=0.0, max=1.0, help='Choose a threshold that keeps it.'),
    ] = None,
    max_persons_safe: Annotated[
        float | None,
        typer.Option(metavar='SHARE', min=0.0, max=1.0, help='And this share of people.'),
    ] = None,
    save: Annotated[
        bool, typer.Option('--save', help='Write the chosen threshold into the bundle.')
    ] = False,
    json_file: options.JsonFile = None,
    html: Annotated[
        Path | None, typer.Option(metavar='DIR', help='Write report.html with pictures here.')
    ] = None,
) -> None:
    """Measure how safe what the heatmaps call safe is, on labelled images.

    Give one of --dataset with --root, --images with --labels, --manifest, or --drawn.
    """
    console = Console()
    if save and max_false_safe is None:
        raise DatasetError('--save without --max-false-safe: there is no threshold to save')
    inputs = EvaluationInputs(
        dataset, root, images, labels, manifest, drawn, drawn_seed, drawn_px,
        classes, split, mixed, limit,
    )  # fmt: skip
    if html is not None:
        # Before the work, which takes minutes: the page needs an extra.
        import peace_ros.lab.evaluation.segmentation.html  # noqa: F401
    source = open_source(inputs)
    overrides = Overrides(
        clip=clip,
        clipseg=clipseg,
        fastsam=fastsam,
        fusion=fusion,
        terms=terms,
        max_looks=max_looks or source.max_looks,
        threads=threads,
    )
    configurations = _configurations([*(config or []), *(more_configs or [])], overrides, console)
    if threshold is not None and not 0.0 < threshold < 1.0:
        raise DatasetError(f'--threshold {threshold}: give a score between 0 and 1, both excluded')
    side = WHOLE if whole else tile_px
    outcome = _run(source, configurations, side, strict, not no_terms, console)
    named = {
        cores.name: figures_of(cores, outcome.tallies[cores.name], outcome, threshold)
        for cores in configurations
    }
    console.print(f'\n[bold]{outcome.source.title}[/bold]')
    console.print(figures_table(named))
    for sentence in remarks_of(named, outcome):
        console.print(sentence, highlight=False, soft_wrap=True)
    try:
        if max_false_safe is not None:
            budget = RiskBudget(max_false_safe, max_persons_safe)
            _choose(configurations, outcome, budget, named, console, save=save)
    finally:
        # What was measured is kept, also when no threshold keeps the budget.
        _write(named, outcome, configurations, side, json_file, html, console)


def _configurations(names: list[str], overrides: Overrides, console: Console) -> list[Cores]:
    wanted = [each for name in names for each in name.split(',') if each] or [DEFAULT_CONFIG]
    if wanted == ['all']:
        wanted = list(ALL_CONFIGS)
    found: dict[str, Cores] = {}
    for name in wanted:
        cores = build_cores(name, overrides)
        if isinstance(cores, str):
            console.print(cores, highlight=False, soft_wrap=True)
        else:
            found[cores.name] = cores
    if not found:
        raise DatasetError('no configuration is left to evaluate: give the bundles that they lack')
    return list(found.values())


def _run(
    source: SampleSource,
    configurations: list[Cores],
    tile_px: int | None,
    strict: bool,
    score_terms: bool,
    console: Console,
) -> Outcome:
    with over_images(console, len(source.samples)) as report:
        return run_evaluation(
            source,
            configurations,
            tile_px=tile_px,
            strict=strict,
            score_terms=score_terms,
            report=report,
        )


def _choose(
    configurations: list[Cores],
    outcome: Outcome,
    budget: RiskBudget,
    named: dict[str, Figures],
    console: Console,
    *,
    save: bool,
) -> None:
    if save and len(configurations) > 1:
        raise DatasetError('--save with several configurations: give the one whose bundle it is')
    for cores in configurations:
        choice = choose_threshold(cores, outcome.tallies[cores.name], budget)
        named[cores.name]['choice'] = {**asdict(choice), 'max_false_safe': budget.false_safe}
        console.print(
            f'{cores.name}: threshold {choice.threshold:.4f} keeps false-safe at '
            f'{choice.false_safe:.2%} (up to {choice.false_safe_limit:.2%}), recall '
            f'{choice.recall:.2%}, mIoU {choice.miou:.2%}',
            highlight=False,
            soft_wrap=True,
        )
        if save:
            console.print(f'saved in {save_threshold(cores, choice, budget)}', soft_wrap=True)


def _write(
    named: dict[str, Figures],
    outcome: Outcome,
    configurations: list[Cores],
    tile_px: int | None,
    json_file: Path | None,
    html: Path | None,
    console: Console,
) -> None:
    figures: dict[str, Any] = together(named, outcome)
    try:
        if json_file is not None:
            json_file.parent.mkdir(parents=True, exist_ok=True)
            json_file.write_text(json.dumps(figures, indent=2) + '\n', encoding='utf-8')
        if html is not None:
            from peace_ros.lab.evaluation.segmentation.html import write_report

            report = write_report(html, named, outcome, configurations, tile_px)
            console.print(f'report: {report}', soft_wrap=True)
    except OSError as error:
        raise DatasetError(f'{error.filename} cannot be written: {error.strerror}') from error
