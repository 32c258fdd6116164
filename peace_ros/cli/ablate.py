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

from peace_ros.cli import image_options as options
from peace_ros.lab.evaluation.ablation.figures import ablation_figures
from peace_ros.lab.evaluation.ablation.run import ablate as run_ablation
from peace_ros.lab.evaluation.ablation.table import markdown, put_into
from peace_ros.lab.evaluation.ablation.variants import default_variants
from peace_ros.lab.evaluation.segmentation.cores import Overrides, build_cores
from peace_ros.lab.evaluation.segmentation.errors import DatasetError
from peace_ros.lab.evaluation.segmentation.inputs import EvaluationInputs, open_source
from peace_ros.lab.evaluation.segmentation.progress import over_images
from peace_ros.lab.evaluation.segmentation.samples import CAMERA_PX
from peace_ros.lab.evaluation.segmentation.tiles import WHOLE


def ablate(
    *,
    config: Annotated[
        str, typer.Option(metavar='PRESET', help='Preset or file of the family clipseg.')
    ] = 'peace_cs',
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
    most_words: Annotated[
        int, typer.Option(metavar='K', min=1, max=10, help='Environment words, 0 to K.')
    ] = 3,
    template: Annotated[
        list[str] | None,
        typer.Option(metavar='SENTENCE', help='A further template, with {term}; several allowed.'),
    ] = None,
    terms: options.TermsFile = '',
    vocabularies: Annotated[
        str, typer.Option(metavar='FILE', help='Vocabularies in place of the preset.')
    ] = '',
    clip: options.ClipBundle = '',
    clipseg: options.ClipSegBundle = '',
    threads: options.Threads = 2,
    strict: options.Strict = False,
    json_file: options.JsonFile = None,
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
    inputs = EvaluationInputs(
        dataset, root, images, labels, manifest, drawn, drawn_seed, drawn_px,
        classes, split, mixed, limit,
    )  # fmt: skip
    source = open_source(inputs)
    overrides = Overrides(
        clip=clip,
        clipseg=clipseg,
        terms=terms,
        vocabularies=vocabularies,
        max_looks=max_looks or source.max_looks,
        threads=threads,
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
