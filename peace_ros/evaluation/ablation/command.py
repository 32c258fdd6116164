# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""``peace ablate``."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.markdown import Markdown

from peace_ros.evaluation.ablation.figures import ablation_figures
from peace_ros.evaluation.ablation.run import ablate as run_ablation
from peace_ros.evaluation.ablation.table import markdown, put_into
from peace_ros.evaluation.ablation.variants import default_variants
from peace_ros.evaluation.segmentation.classes import MIXED, dataset_names
from peace_ros.evaluation.segmentation.cores import Overrides, build_cores
from peace_ros.evaluation.segmentation.errors import DatasetError
from peace_ros.evaluation.segmentation.inputs import Inputs, open_source
from peace_ros.evaluation.segmentation.progress import over_images
from peace_ros.evaluation.segmentation.tiles import WHOLE


def ablate(
    *,
    config: Annotated[
        str, typer.Option(metavar='PRESET', help='Preset or file of the family clipseg.')
    ] = 'peace_cs',
    dataset: Annotated[
        str, typer.Option(metavar='NAME', help=f'One of {", ".join(dataset_names())}.')
    ] = '',
    root: Annotated[
        Path | None, typer.Option(metavar='DIR', help='Where the dataset was unpacked.')
    ] = None,
    images: Annotated[
        Path | None, typer.Option(metavar='DIR', help='Folder of images; needs --labels.')
    ] = None,
    labels: Annotated[
        Path | None, typer.Option(metavar='DIR', help='Folder of label PNGs, same stems.')
    ] = None,
    manifest: Annotated[
        Path | None, typer.Option(metavar='FILE', help='CSV with columns image, label, split.')
    ] = None,
    drawn: Annotated[int, typer.Option(metavar='N', min=0, help='Draw N scenes.')] = 0,
    drawn_seed: Annotated[
        int | None, typer.Option(metavar='SEED', min=0, help='First seed of the drawn scenes.')
    ] = None,
    classes: Annotated[
        str, typer.Option(metavar='NAME|FILE', help='Class table of --labels and --manifest.')
    ] = 'common',
    split: Annotated[str, typer.Option(help='Only this split of the dataset or manifest.')] = '',
    mixed: Annotated[
        str, typer.Option(help=f'Classes of safe and unsafe ground alike: {", ".join(MIXED)}.')
    ] = 'ignore',
    limit: Annotated[
        int | None, typer.Option(metavar='N', min=1, help='At most N images, evenly spread.')
    ] = None,
    tile_px: Annotated[
        int | None,
        typer.Option(metavar='N', min=16, help='Side of the squares; default the shorter side.'),
    ] = None,
    whole: Annotated[
        bool, typer.Option('--whole', help='Whole frames, stretched as the node does it.')
    ] = False,
    most_words: Annotated[
        int, typer.Option(metavar='K', min=1, max=10, help='Environment words, 0 to K.')
    ] = 3,
    template: Annotated[
        list[str] | None,
        typer.Option(metavar='SENTENCE', help='A further template, with {term}; several allowed.'),
    ] = None,
    terms: Annotated[str, typer.Option(metavar='FILE', help='Terms in place of the preset.')] = '',
    vocabularies: Annotated[
        str, typer.Option(metavar='FILE', help='Vocabularies in place of the preset.')
    ] = '',
    clip: Annotated[str, typer.Option(metavar='BUNDLE', help='CLIP that ranks words.')] = '',
    clipseg: Annotated[str, typer.Option(metavar='BUNDLE', help='CLIPSeg to use.')] = '',
    threads: Annotated[int, typer.Option(min=1, max=64, help='CPU threads.')] = 2,
    strict: Annotated[
        bool, typer.Option('--strict', help='Refuse at the first image that cannot be scored.')
    ] = False,
    json_file: Annotated[
        Path | None, typer.Option('--json', metavar='FILE', help='Write the figures here.')
    ] = None,
    table: Annotated[
        Path | None, typer.Option(metavar='FILE', help='Write the Markdown tables here.')
    ] = None,
    into: Annotated[
        Path | None,
        typer.Option(metavar='FILE', help='Put the tables between the marks of this document.'),
    ] = None,
) -> None:
    """Measure what vocabularies, templates, words, fusion and thresholds are worth.

    Takes the images that `peace evaluate` takes; each is encoded once for all variants.
    """
    console = Console()
    inputs = Inputs(
        dataset, root, images, labels, manifest, drawn, drawn_seed, classes, split, mixed, limit
    )
    source = open_source(inputs)
    overrides = Overrides(
        clip=clip, clipseg=clipseg, terms=terms, vocabularies=vocabularies, threads=threads
    )
    cores = build_cores(config, overrides)
    if isinstance(cores, str):
        raise DatasetError(cores)
    variants = default_variants(most_words, template or ())
    with over_images(console, len(source.samples)) as report:
        counted = run_ablation(
            source,
            cores,
            variants,
            tile_px=WHOLE if whole else tile_px,
            strict=strict,
            report=report,
        )
    figures = {'source': source.title, **ablation_figures(counted, cores)}
    text = markdown(figures, source.title)
    console.print(Markdown(text))
    if counted.skipped:
        console.print(f'{len(counted.skipped)} images skipped, not scored; see --json')
    try:
        if json_file is not None:
            json_file.write_text(json.dumps(figures, indent=2) + '\n', encoding='utf-8')
        if table is not None:
            table.write_text(text, encoding='utf-8')
        if into is not None:
            put_into(into, text)
    except OSError as error:
        raise DatasetError(f'{error.filename} cannot be written: {error.strerror}') from error
