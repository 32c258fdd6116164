# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The report of an evaluation: one page that needs no other file.

Needs jinja2 and matplotlib (the extra ``lab``); the page itself is ``templates/report.html.j2``.
"""

from __future__ import annotations

from importlib.resources import files
from pathlib import Path
from typing import Any

from peace_ros import __version__
from peace_ros.core.domain import ConfigurationError
from peace_ros.lab.evaluation.segmentation.cores import Cores
from peace_ros.lab.evaluation.segmentation.errors import SampleError
from peace_ros.lab.evaluation.segmentation.figures import Figures
from peace_ros.lab.evaluation.segmentation.pictures import LABEL_COLOURS, PANELS, panels
from peace_ros.lab.evaluation.segmentation.run import Outcome
from peace_ros.lab.evaluation.segmentation.table import percent, remarks_of, sections
from peace_ros.recording.run_folder import write_whole

try:
    from jinja2 import Environment, StrictUndefined

    from peace_ros.lab.evaluation.segmentation.charts import COLOURS, charts
except ImportError as error:
    raise ConfigurationError(
        f'the report needs {error.name}: run pip install jinja2 matplotlib'
    ) from error

NAME = 'report.html'
_WORST, _BEST = 6, 3


def write_report(
    folder: Path,
    named: dict[str, Figures],
    outcome: Outcome,
    configurations: list[Cores],
    tile_px: int | None,
) -> Path:
    """Write report.html into a folder, which is made; return the file. Raises OSError."""
    folder.mkdir(parents=True, exist_ok=True)
    tile_px = outcome.source.tile_px if tile_px is None else tile_px
    environment = Environment(
        autoescape=True, trim_blocks=True, lstrip_blocks=True, undefined=StrictUndefined
    )
    environment.filters['percent'] = percent
    template = files(__package__) / 'templates' / f'{NAME}.j2'
    summary, hazards, terms, counts = sections(named)
    page = environment.from_string(template.read_text('utf-8')).render(
        title=outcome.source.title,
        version=__version__,
        named=named,
        first=next(iter(named.values())),
        remarks=[line for line in remarks_of(named, outcome) if not line.startswith(' ')],
        summary=summary + counts,
        hazards=hazards,
        terms=terms,
        charts=charts(named),
        colours=COLOURS,
        labels=LABEL_COLOURS,
        panels=PANELS,
        pictures={
            cores.name: _pictures(cores, named[cores.name], outcome, tile_px)
            for cores in configurations
        },
        skipped=outcome.skipped,
    )
    path = folder / NAME
    write_whole(path, page, 'report')
    return path


def _pictures(
    cores: Cores, figures: Figures, outcome: Outcome, tile_px: int | None
) -> dict[str, list[Figures]]:
    """Return heading -> frames, each with its panels or the error that stood in the way."""
    frames: list[Figures] = figures['per_frame']
    worst = sorted(frames, key=lambda each: -(each['unsafe_called_safe_area'] or 0.0))[:_WORST]
    rated = [each for each in frames if each['recall'] is not None and each not in worst]
    best = sorted(rated, key=lambda each: -(each['miou'] or 0.0))[:_BEST]
    samples = {sample.name: sample for sample in outcome.source.samples}
    score = cores.heatmap_score(figures['threshold'])

    def with_panels(frame: Figures) -> dict[str, Any]:
        try:
            pair = samples[frame['name']].load()
        except SampleError as error:
            return {**frame, 'panels': [], 'error': str(error)}
        return {**frame, 'panels': panels(pair, cores, tile_px, score), 'error': ''}

    return {
        'Most unsafe ground called safe': [with_panels(each) for each in worst],
        'Highest mIoU': [with_panels(each) for each in best],
    }
