# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""``peace evaluate``."""

from __future__ import annotations

from dataclasses import asdict
from functools import partial
from pathlib import Path
from typing import Annotated

from rich.console import Console
from rich.progress import track
from typer import Argument, Option

from peace_ros.cli.image_options import ImageOptions
from peace_ros.cli.options import with_options
from peace_ros.core.segmentation import FUSIONS
from peace_ros.lab.evaluation.segmentation.cores import Cores, Overrides, build_cores
from peace_ros.lab.evaluation.segmentation.errors import DatasetError
from peace_ros.lab.evaluation.segmentation.figures import figures_of, together
from peace_ros.lab.evaluation.segmentation.run import evaluate as run_evaluation
from peace_ros.lab.evaluation.segmentation.table import figures_table, remarks_of
from peace_ros.lab.evaluation.segmentation.threshold import (
    RiskBudget,
    choose_threshold,
    save_threshold,
)

DEFAULT_CONFIG = 'peace_cs'
ALL_CONFIGS = ('dd_cs', 'd_cs', 'peace_cs', 'dd_fs', 'd_fs', 'peace_fs')


@with_options(ImageOptions)
def evaluate(
    *,
    options: ImageOptions,
    more_configs: Annotated[
        list[str] | None, Argument(metavar='CONFIG', help='Like --config.')
    ] = None,
    config: Annotated[
        list[str] | None,
        Option(
            metavar='PRESET',
            help=f'Preset or file, several allowed; all: {", ".join(ALL_CONFIGS)}.',
        ),
    ] = None,
    threshold: Annotated[
        float | None,
        Option(metavar='SCORE', help="The network's score; default: the bundle's own."),
    ] = None,
    fusion: Annotated[str, Option(help=f'In place of the presets: {", ".join(FUSIONS)}.')] = '',
    fastsam: Annotated[str, Option(metavar='BUNDLE', help='FastSAM of *_fs.')] = '',
    no_terms: Annotated[
        bool, Option('--no-terms', help='Do not score each term by itself.')
    ] = False,
    max_false_safe: Annotated[
        float | None,
        Option(metavar='SHARE', min=0.0, max=1.0, help='Choose a threshold that keeps it.'),
    ] = None,
    max_persons_safe: Annotated[
        float | None,
        Option(metavar='SHARE', min=0.0, max=1.0, help='And this share of people.'),
    ] = None,
    save: Annotated[
        bool, Option('--save', help='Write the chosen threshold into the bundle.')
    ] = False,
    html: Annotated[
        Path | None, Option(metavar='DIR', help='Write report.html with pictures here.')
    ] = None,
) -> None:
    """Measure how safe what the heatmaps call safe is, on labelled images.

    Give one of --dataset with --root, --images with --labels, --manifest, or --drawn.
    """
    # What is printed holds paths, which may look like markup.
    console = Console(soft_wrap=True, highlight=False, markup=False)
    if save and max_false_safe is None:
        raise DatasetError('--save without --max-false-safe: there is no threshold to save')
    if threshold is not None and not 0.0 < threshold < 1.0:
        raise DatasetError(f'--threshold {threshold}: give a score between 0 and 1, both excluded')
    if html is not None:
        # Before the work, which takes minutes: the page needs an extra.
        from peace_ros.lab.evaluation.segmentation.html import write_report
    source, overrides = options.open(fastsam=fastsam, fusion=fusion)
    configurations = _configurations([*(config or []), *(more_configs or [])], overrides, console)
    if save and len(configurations) > 1:
        raise DatasetError('--save with several configurations: give the one whose bundle it is')
    outcome = run_evaluation(
        source,
        configurations,
        tile_px=options.side_px,
        strict=options.strict,
        score_terms=not no_terms,
        watch=partial(track, description='images', console=console, transient=True),
    )
    named = {
        cores.name: figures_of(cores, outcome.tallies[cores.name], outcome, threshold)
        for cores in configurations
    }
    console.print(f'\n{source.title}', style='bold')
    console.print(figures_table(named), soft_wrap=False)
    for sentence in remarks_of(named, outcome):
        console.print(sentence)

    def write_page() -> None:
        if html is not None:
            page = write_report(html, named, outcome, configurations, options.side_px)
            console.print(f'report: {page}')

    try:
        for cores in configurations if max_false_safe is not None else ():
            budget = RiskBudget(max_false_safe or 0.0, max_persons_safe)
            choice = choose_threshold(cores, outcome.tallies[cores.name], budget)
            named[cores.name]['choice'] = {**asdict(choice), 'max_false_safe': max_false_safe}
            console.print(
                f'{cores.name}: threshold {choice.threshold:.4f} keeps false-safe at '
                f'{choice.false_safe:.2%} (up to {choice.false_safe_limit:.2%}), recall '
                f'{choice.recall:.2%}, mIoU {choice.miou:.2%}'
            )
            if save:
                console.print(f'saved in {save_threshold(cores, choice, budget)}')
    finally:
        # What was measured is kept, also when no threshold keeps the budget.
        options.write(together(named, outcome), write_page)


def _configurations(names: list[str], overrides: Overrides, console: Console) -> list[Cores]:
    wanted = [each for name in names for each in name.split(',') if each] or [DEFAULT_CONFIG]
    found: dict[str, Cores] = {}
    for name in ALL_CONFIGS if wanted == ['all'] else wanted:
        cores = build_cores(name, overrides)
        if isinstance(cores, str):
            console.print(cores)
        else:
            found[cores.name] = cores
    if not found:
        raise DatasetError('no configuration is left to evaluate: give the bundles that they lack')
    return list(found.values())
