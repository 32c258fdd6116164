# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""``peace ablate``."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Annotated

from rich.console import Console
from rich.markdown import Markdown
from rich.progress import track
from typer import Option

from peace_ros.cli.image_options import ImageOptions
from peace_ros.cli.options import with_options
from peace_ros.lab.evaluation.ablation.figures import ablation_figures
from peace_ros.lab.evaluation.ablation.run import ablate as run_ablation
from peace_ros.lab.evaluation.ablation.table import markdown, put_into
from peace_ros.lab.evaluation.ablation.variants import default_variants
from peace_ros.lab.evaluation.segmentation.cores import build_cores
from peace_ros.lab.evaluation.segmentation.errors import DatasetError
from peace_ros.recording.run_folder import write_whole


@with_options(ImageOptions)
def ablate(
    *,
    options: ImageOptions,
    config: Annotated[
        str, Option(metavar='PRESET', help='Preset or file of the family clipseg.')
    ] = 'peace_cs',
    most_words: Annotated[
        int, Option(metavar='K', min=1, max=10, help='Environment words, 0 to K.')
    ] = 3,
    template: Annotated[
        list[str] | None,
        Option(metavar='SENTENCE', help='A further template, with {term}; several allowed.'),
    ] = None,
    vocabularies: Annotated[
        str, Option(metavar='FILE', help='Vocabularies in place of the preset.')
    ] = '',
    table: Annotated[
        Path | None, Option(metavar='FILE', help='Write the Markdown tables here.')
    ] = None,
    into: Annotated[
        Path | None,
        Option(metavar='FILE', help='Put the tables between the marks of this document.'),
    ] = None,
) -> None:
    """Measure what vocabularies, templates, words, fusion and thresholds are worth.

    Takes the images that `peace evaluate` takes; each is encoded once for all variants.
    """
    console = Console(markup=False)
    source, overrides = options.open(vocabularies=vocabularies)
    cores = build_cores(config, overrides)
    if isinstance(cores, str):
        raise DatasetError(cores)
    counted = run_ablation(
        source,
        cores,
        default_variants(most_words, template or ()),
        tile_px=options.side_px,
        strict=options.strict,
        watch=partial(track, description='images', console=console, transient=True),
    )
    figures = {'source': source.title, **ablation_figures(counted, cores)}
    text = markdown(figures, source.title)
    console.print(Markdown(text))
    if counted.skipped:
        console.print(f'{len(counted.skipped)} images skipped, not scored; see --json')

    def write_tables() -> None:
        if table is not None:
            write_whole(table, text, 'table')
        if into is not None:
            put_into(into, text)

    options.write(figures, write_tables)
