# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The report for someone who was not there: one page without other files."""

from __future__ import annotations

from html import escape
from pathlib import Path
from typing import Any

from peace_ros import __version__
from peace_ros.core.domain import Label
from peace_ros.lab.evaluation.segmentation.charts import COLOURS, Line, chart
from peace_ros.lab.evaluation.segmentation.cores import Cores
from peace_ros.lab.evaluation.segmentation.errors import SampleError
from peace_ros.lab.evaluation.segmentation.figures import Figures
from peace_ros.lab.evaluation.segmentation.metrics import HAZARDS
from peace_ros.lab.evaluation.segmentation.pictures import LABEL_COLOURS, PANELS, strip
from peace_ros.lab.evaluation.segmentation.run import Outcome
from peace_ros.lab.evaluation.segmentation.samples import Sample
from peace_ros.lab.evaluation.segmentation.table import ROWS, percent, remarks_of

NAME = 'report.html'
_WORST, _BEST = 6, 3
_STYLE = """
body { font: 15px/1.5 system-ui, sans-serif; color: #1f2328; max-width: 1320px; margin: 0 auto;
  padding: 24px; }
h1 { font-size: 24px; margin: 0 0 4px; } h2 { font-size: 19px; margin: 32px 0 8px; }
h3 { font-size: 16px; margin: 20px 0 6px; }
table { border-collapse: collapse; margin: 8px 0; }
th, td { padding: 3px 14px 3px 0; text-align: right; border-bottom: 1px solid #e4e7eb; }
th:first-child, td:first-child { text-align: left; }
thead th { border-bottom: 2px solid #8c959f; }
td.text { text-align: left; } td small { color: #57606a; }
.charts { display: flex; flex-wrap: wrap; gap: 12px; } .charts svg { width: 400px; }
svg .grid { stroke: #e4e7eb; } svg .tick { font-size: 11px; fill: #57606a; }
svg .label { font-size: 12px; } svg .title { font-size: 13px; font-weight: 600; }
figure { margin: 0 0 16px; } figure img { max-width: 100%; display: block; }
figcaption { color: #57606a; }
.swatch { display: inline-block; width: 12px; height: 12px; margin: 0 4px 0 14px; }
.note { color: #57606a; }
"""


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
    body = [
        _head(named, outcome),
        _summary(named),
        _charts(named),
        _hazards(named),
        _terms(named),
        *(_pictures(cores, named[cores.name], outcome, tile_px) for cores in configurations),
        _skipped(outcome),
        _method(named),
    ]
    page = (
        f'<!doctype html><html lang="en"><head><meta charset="utf-8"><title>'
        f'{escape(outcome.source.title)}</title><style>{_STYLE}</style></head><body>'
        + '\n'.join(body)
        + '</body></html>\n'
    )
    path = folder / NAME
    path.write_text(page, encoding='utf-8')
    return path


def _head(named: dict[str, Figures], outcome: Outcome) -> str:
    name, first = next(iter(named.items()))
    remarks = [line for line in remarks_of(named, outcome) if not line.startswith(' ')]
    notes = ''.join(f'<p class="note">{escape(line)}</p>' for line in remarks)
    return (
        '<h1>How safe is what the heatmaps call safe?</h1>'
        f'<p class="note">{escape(outcome.source.title)}, {first["frames"]} frames, '
        f'peace_ros {__version__}</p>'
        f'<p>{escape(name)} scores a mean IoU of <b>{percent(first["miou"])} %</b>, where an '
        f'answer that calls everything unsafe scores {percent(first["baseline_miou"])} %. Of the '
        f'ground that it calls safe <b>{percent(first["false_safe"])} %</b> is unsafe, and it '
        f'finds {percent(first["recall"])} % of the safe ground.</p>{notes}'
    )


def _summary(named: dict[str, Figures]) -> str:
    rows = [
        (title, [_cell(each[key], each[f'{key}_interval']) for each in named.values()])
        for key, title in ROWS
    ]
    rows += [
        ("threshold (the network's score)", [f'{e["threshold"]:.3f}' for e in named.values()]),
        ('frames (tiles)', [f'{e["frames"]} ({e["tiles"]})' for e in named.values()]),
        (
            'tiles per second',
            ['-' if each['hz'] is None else f'{each["hz"]:.1f}' for each in named.values()],
        ),
    ]
    return '<h2>Figures, in per cent</h2>' + _table(list(named), rows) + _choices(named)


def _choices(named: dict[str, Figures]) -> str:
    sentences = []
    for name, each in named.items():
        choice = each.get('choice')
        if choice is not None:
            sentences.append(
                f'<p>{escape(name)}: threshold <b>{choice["threshold"]:.4f}</b> keeps false-safe '
                f'within {percent(choice["max_false_safe"])} %: {percent(choice["false_safe"])} % '
                f'(up to {percent(choice["false_safe_limit"])} %), at a recall of '
                f'{percent(choice["recall"])} %.</p>'
            )
    return ''.join(sentences)


def _cell(value: float | None, interval: list[float] | None) -> str:
    if value is None or interval is None:
        return percent(value)
    return f'{percent(value)} <small>({percent(interval[0])} to {percent(interval[1])})</small>'


def _table(columns: list[str], rows: list[tuple[str, list[str]]]) -> str:
    """Return a table; cells are HTML already, titles are not."""
    head = ''.join(f'<th>{escape(each)}</th>' for each in ['', *columns])
    body = ''.join(
        f'<tr><td>{escape(title)}</td>{"".join(f"<td>{cell}</td>" for cell in cells)}</tr>'
        for title, cells in rows
    )
    return f'<table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>'


def _charts(named: dict[str, Figures]) -> str:
    trade: list[Line] = []
    over: list[Line] = []
    calibration = [Line('ideal', [(0.0, 0.0), (1.0, 1.0)], '#8c959f', dashed=True)]
    for place, (name, each) in enumerate(named.items()):
        colour = COLOURS[place % len(COLOURS)]
        curve: list[dict[str, Any]] = each['curve']
        precision = None if each['false_safe'] is None else 1.0 - each['false_safe']
        points = [(point['recall'], point['precision']) for point in curve]
        trade.append(Line(name, points, colour, (each['recall'], precision)))
        at = each['threshold']
        for key, dashed in (('recall', False), ('false_safe', True)):
            points = [(point['threshold'], point[key]) for point in curve]
            over.append(Line(f'{name}, {key}', points, colour, (at, each[key]), dashed))
        points = [(point['score'], point['safe']) for point in each['reliability']]
        calibration.append(Line(name, points, colour))
    drawings = [
        chart('Precision over recall of safe ground', 'recall, %', 'precision, %', trade),
        chart('Recall (line) and false-safe (dashed)', 'threshold, %', '%', over),
        chart('Reliability of the heatmap', 'score, %', 'of it safe, %', calibration),
    ]
    legend = ''.join(
        f'<span class="swatch" style="background:{COLOURS[place % len(COLOURS)]}"></span>'
        f'{escape(name)}'
        for place, name in enumerate(named)
    )
    return (
        f'<h2>Over the threshold</h2><p class="note">{legend} · a dot marks the threshold in use'
        f'</p><div class="charts">{"".join(drawings)}</div>'
    )


def _hazards(named: dict[str, Figures]) -> str:
    key = 'false_safe_by_hazard'
    rows = [
        (hazard, [_cell(e[key][hazard], e[f'{key}_interval'][hazard]) for e in named.values()])
        for hazard in HAZARDS
    ]
    return '<h2>Hazards called safe, per cent of their pixels</h2>' + _table(list(named), rows)


def _terms(named: dict[str, Figures]) -> str:
    terms = dict.fromkeys(term for each in named.values() for term in each['iou_by_term'])
    if not terms:
        return ''
    rows = [
        (
            term,
            [
                _cell(e['iou_by_term'].get(term), e['iou_by_term_interval'].get(term))
                for e in named.values()
            ],
        )
        for term in terms
    ]
    return (
        '<h2>IoU of each term, per cent</h2><p class="note">Each at the threshold that is best for '
        'it on these frames; a dash: nothing of the kind is in them.</p>'
        + _table(list(named), rows)
    )


def _pictures(cores: Cores, figures: Figures, outcome: Outcome, tile_px: int | None) -> str:
    frames: list[dict[str, Any]] = figures['per_frame']
    worst = sorted(frames, key=lambda each: -(each['unsafe_called_safe_area'] or 0.0))[:_WORST]
    rated = [each for each in frames if each['recall'] is not None and each not in worst]
    best = sorted(rated, key=lambda each: -(each['miou'] or 0.0))[:_BEST]
    samples = {sample.name: sample for sample in outcome.source.samples}
    score = cores.heatmap_score(figures['threshold'])
    swatches = ''.join(
        f'<span class="swatch" style="background:rgb{LABEL_COLOURS[label]}"></span>'
        f'{label.name.lower().replace("_", " ")}'
        for label in Label
    )
    parts = [
        f'<h2>{escape(cores.name)}: worst and best frames</h2><p class="note">',
        f'{", ".join(PANELS)}. Truth: {swatches}. Heatmap: dark is unsafe, yellow is safe.</p>',
        '<h3>Most unsafe ground called safe</h3>',
    ]
    parts += [_figure(each, samples, cores, tile_px, score) for each in worst]
    if best:
        parts.append('<h3>Highest mIoU</h3>')
        parts += [_figure(each, samples, cores, tile_px, score) for each in best]
    return ''.join(parts)


def _figure(
    frame: dict[str, Any],
    samples: dict[str, Sample],
    cores: Cores,
    tile_px: int | None,
    score: float,
) -> str:
    caption = (
        f'{frame["name"]}: {percent(frame["unsafe_called_safe_area"])} % of the frame is unsafe '
        f'and called safe, recall {percent(frame["recall"])} %, mIoU {percent(frame["miou"])} %'
    )
    try:
        pair = samples[frame['name']].load()
    except SampleError as error:
        return f'<p>{escape(caption)}; no picture: {escape(str(error))}</p>'
    return (
        f'<figure><img alt="{escape(caption)}" src="{strip(pair, cores, tile_px, score)}">'
        f'<figcaption>{escape(caption)}</figcaption></figure>'
    )


def _skipped(outcome: Outcome) -> str:
    if not outcome.skipped:
        return '<h2>Skipped</h2><p>Nothing.</p>'
    rows = ''.join(
        f'<tr><td>{escape(each.name)}</td><td class="text">{escape(each.reason)}</td></tr>'
        for each in outcome.skipped
    )
    return f'<h2>Skipped: {len(outcome.skipped)}, not scored</h2><table>{rows}</table>'


def _method(named: dict[str, Figures]) -> str:
    models = ''.join(_model(name, each['model']) for name, each in named.items())
    return (
        '<h2>How this was measured</h2><p>Safe is grass and bare ground, unsafe is every other '
        'labelled class; unlabelled pixels do not count. Figures pool the pixels of all frames; '
        'intervals cover 95 % when whole frames are drawn again (1000 times). False-safe is the '
        'unsafe share of the ground called safe. Calibration compares the score of the heatmap, '
        'in ten steps, with the share of ground that is safe there. Large images are cut into '
        'squares, each pixel counted once.</p><ul>' + models + '</ul>'
    )


def _model(name: str, model: dict[str, Any]) -> str:
    text = (
        f'{name}: {model["bundle"]} ({model["precision"]}, checksum {model["checksum"][:12]}), '
        f'template {model["template"]}, fusion {model["fusion"]}'
    )
    return f'<li>{escape(text)}</li>'
