# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Options that commands over labelled images share."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from peace_ros.lab.evaluation.segmentation.classes import MIXED, dataset_names

DatasetName = Annotated[
    str, typer.Option(metavar='NAME', help=f'One of {", ".join(dataset_names())}; needs --root.')
]
Root = Annotated[Path | None, typer.Option(metavar='DIR', help='Where the dataset was unpacked.')]
Images = Annotated[
    Path | None, typer.Option(metavar='DIR', help='Folder of images; needs --labels.')
]
Labels = Annotated[
    Path | None, typer.Option(metavar='DIR', help='Folder of label PNGs, same stems.')
]
Manifest = Annotated[
    Path | None, typer.Option(metavar='FILE', help='CSV with columns image, label, split.')
]
Drawn = Annotated[int, typer.Option(metavar='N', min=0, help='Draw N scenes.')]
DrawnSeed = Annotated[
    int | None, typer.Option(metavar='SEED', min=0, help='First seed of the drawn scenes.')
]
DrawnPx = Annotated[
    int,
    typer.Option(metavar='N', min=64, max=4096, help='Side of the camera that sees the scenes.'),
]
MaxLooks = Annotated[
    int,
    typer.Option(
        metavar='N',
        min=0,
        help='Looks per tile, *_cs; 1: whole only, 0: as dataset and preset say.',
    ),
]
ClassTable = Annotated[
    str, typer.Option(metavar='NAME|FILE', help='Class table of --labels and --manifest.')
]
Split = Annotated[str, typer.Option(help='Only this split of the dataset or manifest.')]
Mixed = Annotated[
    str, typer.Option(help=f'Classes of safe and unsafe ground alike: {", ".join(MIXED)}.')
]
Limit = Annotated[
    int | None, typer.Option(metavar='N', min=1, help='At most N images, evenly spread.')
]
TilePx = Annotated[
    int | None,
    typer.Option(metavar='N', min=16, help='Side of the squares; default the shorter side.'),
]
Whole = Annotated[
    bool, typer.Option('--whole', help='Whole frames, stretched as the node does it.')
]
TermsFile = Annotated[str, typer.Option(metavar='FILE', help='Terms in place of the preset.')]
ClipBundle = Annotated[str, typer.Option(metavar='BUNDLE', help='CLIP that ranks words.')]
ClipSegBundle = Annotated[str, typer.Option(metavar='BUNDLE', help='CLIPSeg of *_cs.')]
Threads = Annotated[int, typer.Option(min=1, max=64, help='CPU threads.')]
Strict = Annotated[
    bool, typer.Option('--strict', help='Refuse at the first image that cannot be scored.')
]
JsonFile = Annotated[
    Path | None, typer.Option('--json', metavar='FILE', help='Write the figures here.')
]
