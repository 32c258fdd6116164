# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Graphs are held against the tensors of their family before the first frame."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from peace_ros.core.domain import BundleError
from peace_ros.core.inference import Bundle, open_sessions
from peace_ros.core.inference.contract import Graph, Tensor, check_graphs
from peace_ros.core.inference.manifest import Manifest

FLOAT, INT64 = 'tensor(float)', 'tensor(int64)'


@pytest.fixture
def manifest(clipseg_folder: Path) -> Manifest:
    return Bundle.load(clipseg_folder).manifest


@pytest.fixture
def graphs(clipseg_folder: Path) -> dict[str, Graph]:
    sessions = open_sessions(
        Bundle.load(clipseg_folder), ('image_encoder', 'text_encoder', 'decoder'), threads=1
    )
    return {role: session.graph for role, session in sessions.items()}


def with_input(graph: Graph, *tensors: Tensor) -> Graph:
    others = {each.name: each for each in graph.inputs} | {each.name: each for each in tensors}
    return replace(graph, inputs=tuple(others.values()))


def test_a_frozen_number_of_terms_is_refused(manifest: Manifest, graphs: dict[str, Graph]) -> None:
    graphs['decoder'] = with_input(graphs['decoder'], Tensor('is_positive', FLOAT, (13,)))
    with pytest.raises(BundleError, match=r'is_positive tensor\(float\) \[13\] must be .*\[T\]'):
        check_graphs(manifest, graphs)


def test_a_frozen_text_length_is_refused(manifest: Manifest, graphs: dict[str, Graph]) -> None:
    frozen = Tensor('input_ids', INT64, ('B', 77))
    graphs['text_encoder'] = with_input(graphs['text_encoder'], frozen)
    with pytest.raises(BundleError, match=r'input_ids'):
        check_graphs(manifest, graphs)


def test_an_input_that_nobody_feeds_is_refused(
    manifest: Manifest, graphs: dict[str, Graph]
) -> None:
    graphs['decoder'] = with_input(graphs['decoder'], Tensor('weather', FLOAT, (1,)))
    with pytest.raises(BundleError, match='nothing to feed to input weather'):
        check_graphs(manifest, graphs)


def test_another_type_is_refused(manifest: Manifest, graphs: dict[str, Graph]) -> None:
    half = Tensor('text_embedding', 'tensor(float16)', ('T', 8))
    graphs['decoder'] = with_input(graphs['decoder'], half)
    with pytest.raises(BundleError, match=r'tensor\(float16\)'):
        check_graphs(manifest, graphs)


def test_another_number_of_axes_is_refused(manifest: Manifest, graphs: dict[str, Graph]) -> None:
    flat = Tensor('fine', FLOAT, (1, 480))
    graphs['decoder'] = with_input(graphs['decoder'], flat)
    with pytest.raises(BundleError, match='fine'):
        check_graphs(manifest, graphs)


def test_axes_that_the_exporter_left_open_are_taken(
    manifest: Manifest, graphs: dict[str, Graph]
) -> None:
    open_pixels = Tensor('pixel_values', FLOAT, ('N', 3, 'H', 'W'))
    graphs['image_encoder'] = with_input(graphs['image_encoder'], open_pixels)
    check_graphs(manifest, graphs)
