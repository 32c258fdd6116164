# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What threads, precision, provider and graph optimisation do to CLIPSeg's networks."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from peace_ros.core.inference import Bundle, Preprocessor, Session
from peace_ros.core.inference.contract import (
    IS_POSITIVE,
    NEGATIVE,
    PIXEL_VALUES,
    POSITIVE,
    TEXT_EMBEDDING,
)
from peace_ros.core.inference.providers import CPU, OPENVINO, available_providers
from peace_ros.core.inference.session import OPTIMISATIONS
from peace_ros.lab.benchmark.measure import Stopwatch, peak_rss_mb
from peace_ros.lab.benchmark.scene import IS_POSITIVE_13, TERMS_13, draw_frames
from peace_ros.lab.benchmark.worker import run_apart
from peace_ros.lab.markdown import markdown_table

Row = dict[str, Any]

_MEASURE = f'{__name__}:measure_setting'
_FRAMES = 8
_COLUMNS = (
    'precision',
    'provider',
    'threads',
    'graph optimisation',
    'encoder ms',
    'decoder ms',
    'together ms',
    'processor ms',
    'peak MB',
)


def settings(bundles: Mapping[str, str], threads: int) -> list[Row]:
    """Return what is tried: every choice alone, against the others at their best.

    Args:
        bundles: precision -> bundle.
        threads: the most.
    """
    counts = sorted({1, threads})
    found: list[Row] = []
    for precision, bundle in bundles.items():
        for provider in (each for each in (CPU, OPENVINO) if each in available_providers()):
            row = {'bundle': bundle, 'precision': precision, 'provider': provider}
            found += [{**row, 'threads': count, 'optimisation': 'all'} for count in counts]
            if provider == CPU:
                lesser = [each for each in OPTIMISATIONS if each != 'all']
                found += [{**row, 'threads': threads, 'optimisation': each} for each in lesser]
    return found


def sweep(bundles: Mapping[str, str], threads: int, say: Callable[[str], None]) -> list[Row]:
    """Measure every setting in a process of its own. Raises BenchmarkError."""
    rows = []
    for setting in settings(bundles, threads):
        precision = setting.pop('precision')
        label = ', '.join(str(each) for name, each in setting.items() if name != 'bundle')
        say(f'{precision}, {label} ...')
        rows.append({'precision': precision, **setting, **run_apart(_MEASURE, **setting)})
    return rows


def measure_setting(bundle: str, provider: str, threads: int, optimisation: str) -> Row:
    """Time the image encoder and the decoder of 13 terms."""
    opened = Bundle.load(bundle)
    encoder, decoder = (
        Session(
            opened.paths[role], threads=threads, providers=(provider,), optimisation=optimisation
        )
        for role in ('image_encoder', 'decoder')
    )
    preprocess = Preprocessor(opened.manifest.input)
    names = [each.name for each in encoder.graph.outputs]
    sizes = (len(TERMS_13), opened.manifest.embedding_width)
    texts = np.random.default_rng(0).normal(size=sizes).astype(np.float32)
    watch = Stopwatch()
    for frame, stage in watch.warmed(draw_frames(_FRAMES)):
        pixels = preprocess(frame.image_rgb)
        with stage('encoder'):
            features = encoder.run(names, {PIXEL_VALUES: pixels})
        feeds = dict(zip(names, features, strict=True))
        feeds.update({TEXT_EMBEDDING: texts, IS_POSITIVE: IS_POSITIVE_13})
        with stage('decoder'):
            decoder.run([POSITIVE, NEGATIVE], feeds)
    spreads = watch.spreads()
    return {
        'encoder_ms': spreads['encoder'].p50,
        'decoder_ms': spreads['decoder'].p50,
        'networks_ms': spreads['encoder'].p50 + spreads['decoder'].p50,
        'processor_ms': watch.processor_p50('encoder') + watch.processor_p50('decoder'),
        'peak_rss_mb': peak_rss_mb(),
    }


def sweep_table(rows: Sequence[Row], conditions: str) -> str:
    """Return Markdown, the fastest setting first."""
    times = ('encoder_ms', 'decoder_ms', 'networks_ms', 'processor_ms', 'peak_rss_mb')
    table = markdown_table(
        _COLUMNS,
        'llrlrrrrr',
        (
            (
                row['precision'],
                str(row['provider']).removesuffix('ExecutionProvider'),
                str(row['threads']),
                # OpenVINO optimises in its own way.
                row['optimisation'] if row['provider'] == CPU else 'its own',
                *(f'{row[each]:.0f}' for each in times),
            )
            for row in sorted(rows, key=lambda each: float(each['networks_ms']))
        ),
    )
    return f'# peace benchmark --sweep\n\n{conditions}\n\n{table}\n'
