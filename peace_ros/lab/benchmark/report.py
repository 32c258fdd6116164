# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Measurements -> the figures of ``--json`` and a Markdown table."""

from __future__ import annotations

import os
import platform
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import onnxruntime as ort

from peace_ros.lab.benchmark.measure import Measured
from peace_ros.lab.markdown import markdown_table

Figures = dict[str, Any]


NO_BLABBERSEG = 'BlabberSeg is a scheme for CLIPSeg; it has no counterpart for FastSAM'


def clipseg_figures(
    ours: Measured,
    memory: Measured | None,
    reference: Measured | None,
    blabberseg: Measured | None,
) -> Figures:
    """Return the ``clipseg`` object; figures whose measurement was not asked for are None."""
    return {
        **_figures(ours, memory, reference, blabberseg),
        'speedup_vs_reference': _ratio(reference, ours),
        'speedup_vs_blabberseg': _ratio(blabberseg, ours),
        'processor_time_vs_blabberseg': _busy_ratio(blabberseg, ours),
        'processor_time_vs_reference': _busy_ratio(reference, ours),
        'cost_per_further_term': ours.extra['cost_per_term'],
        'peak_rss_mb': (memory or ours).peak_rss_mb,
        'peak_rss_mb_of_all': ours.peak_rss_mb,
        'calls_per_frame_with_dynamic_prompts': ours.extra['calls_per_frame'],
        'ranking_ms': ours.extra['ranking_ms'],
        'prompts': ours.extra['prompts'],
    }


def fastsam_figures(
    ours: Measured, reference: Measured | None, images_only: Measured | None
) -> Figures:
    """Return the ``fastsam`` object; figures whose measurement was not asked for are None.

    Args:
        ours: segments scored in one batch.
        reference: one CLIP call per segment, with the texts in each.
        images_only: the same without the texts.
    """
    return {
        **_figures(ours, reference, images_only),
        'speedup_vs_reference': _ratio(reference, ours),
        'speedup_vs_reference_without_texts': _ratio(images_only, ours),
        'processor_time_vs_reference': _busy_ratio(reference, ours),
        'speedup_vs_blabberseg': None,
        'speedup_vs_blabberseg_reason': NO_BLABBERSEG,
        'segments_per_frame': ours.extra['segments_per_frame'],
    }


def _figures(ours: Measured, *others: Measured | None) -> Figures:
    frame = ours.stages_ms['frame']
    return {
        'frame_ms_p50': frame.p50,
        'frame_ms_p95': frame.p95,
        'frames_per_s': 1e3 / frame.mean,
        'processor_ms_p50': ours.processor_ms,
        'cost_39_over_13_terms': ours.extra['cost_39_over_13_terms'],
        'dynamic_prompt_share': ours.extra['dynamic_prompt_share'],
        'peak_rss_mb': ours.peak_rss_mb,
        'calls_per_frame': ours.extra['steady_calls'],
        'ways': [asdict(each) for each in (ours, *others) if each is not None],
    }


def _ratio(other: Measured | None, ours: Measured) -> float | None:
    return None if other is None else other.stages_ms['frame'].p50 / ours.stages_ms['frame'].p50


def _busy_ratio(other: Measured | None, ours: Measured) -> float | None:
    return None if other is None else other.processor_ms / ours.processor_ms


def markdown(ways: Sequence[Measured], figures: Figures, conditions: str) -> str:
    """Return the table that is printed and saved."""
    stages = markdown_table(
        ('way', 'networks', 'stage', 'p50 ms', 'p95 ms', 'p99 ms', 'frames/s'),
        'lllrrrr',
        (
            (
                way.name,
                way.conditions,
                stage,
                *(f'{each:.1f}' for each in (spread.p50, spread.p95, spread.p99)),
                f'{1e3 / spread.mean:.2f}' if stage == 'frame' else '',
            )
            for way in ways
            for stage, spread in way.stages_ms.items()
        ),
    )
    shown = [(name, _text(value)) for name, value in figures.items() if name != 'ways']
    values = markdown_table(('figure', 'value'), 'll', shown)
    return f'# peace benchmark\n\n{conditions}\n\n{stages}\n\n{values}\n'


def describe_machine(threads: int, terms: int) -> str:
    """Return the conditions of a measurement in a sentence."""
    load = os.getloadavg()[0]
    return (
        f'{_processor()}, {os.cpu_count()} cores, {threads} threads; ONNX Runtime '
        f'{ort.__version__}, Python {platform.python_version()}; {terms} terms; load average '
        f'{load:.1f} at the start.'
    )


def _processor() -> str:
    file = Path('/proc/cpuinfo')
    lines = file.read_text(encoding='utf-8').splitlines() if file.is_file() else []
    names = [line.split(':', 1)[1].strip() for line in lines if 'model name' in line]
    return names[0] if names else platform.machine()


def _text(value: Any) -> str:
    if value is None:
        return 'not measured'
    if isinstance(value, dict):
        return ', '.join(f'{name} {_text(each)}' for name, each in value.items())
    return f'{value:.3g}' if isinstance(value, float) else str(value)
