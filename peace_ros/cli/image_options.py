# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Options that commands over labelled images share."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

from typer import Option

from peace_ros.lab.evaluation.segmentation.cores import Overrides
from peace_ros.lab.evaluation.segmentation.errors import DatasetError
from peace_ros.lab.evaluation.segmentation.inputs import EvaluationInputs, open_source
from peace_ros.lab.evaluation.segmentation.samples import SampleSource
from peace_ros.lab.evaluation.segmentation.tiles import WHOLE
from peace_ros.recording.run_folder import write_whole


@dataclass(frozen=True)
class ImageOptions(EvaluationInputs):
    """Which images, how they are cut, and the models that see them."""

    tile_px: Annotated[
        int | None,
        Option(metavar='N', min=16, help='Side of the squares; default the shorter side.'),
    ] = None
    whole: Annotated[
        bool, Option('--whole', help='Whole frames, stretched as the node does it.')
    ] = False
    max_looks: Annotated[
        int,
        Option(
            metavar='N',
            min=0,
            help='Looks per tile, *_cs; 1: whole only, 0: as dataset and preset say.',
        ),
    ] = 0
    terms: Annotated[str, Option(metavar='FILE', help='Terms in place of the preset.')] = ''
    clip: Annotated[str, Option(metavar='BUNDLE', help='CLIP that ranks words.')] = ''
    clipseg: Annotated[str, Option(metavar='BUNDLE', help='CLIPSeg of *_cs.')] = ''
    threads: Annotated[int, Option(min=1, max=64, help='CPU threads.')] = 2
    strict: Annotated[
        bool, Option('--strict', help='Refuse at the first image that cannot be scored.')
    ] = False
    json_file: Annotated[
        Path | None, Option('--json', metavar='FILE', help='Write the figures here.')
    ] = None

    @property
    def side_px(self) -> int | None:
        """Side of the tiles, as :func:`tiles_of` takes it."""
        return WHOLE if self.whole else self.tile_px

    def open(self, **overrides: Any) -> tuple[SampleSource, Overrides]:
        """Return the images, and what is set in place of the presets; raises DatasetError."""
        source = open_source(self)
        return source, Overrides(
            clip=self.clip,
            clipseg=self.clipseg,
            terms=self.terms,
            max_looks=self.max_looks or source.max_looks,
            threads=self.threads,
            **overrides,
        )

    def write(self, figures: dict[str, Any], also: Callable[[], None]) -> None:
        """Write the figures where --json says, and what else there is; raises DatasetError."""
        try:
            if self.json_file is not None:
                write_whole(self.json_file, json.dumps(figures, indent=2) + '\n', 'figures')
            also()
        except OSError as error:
            raise DatasetError(f'{error.filename} cannot be written: {error.strerror}') from error
