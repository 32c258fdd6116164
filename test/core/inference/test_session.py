# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Sessions count their runs, and graphs that break the family's contract are refused."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from peace_ros.core.domain import BundleError, ConfigurationError
from peace_ros.core.inference import Bundle, Session, open_sessions
from peace_ros.core.inference.providers import CPU, CUDA, TENSORRT
from peace_ros.core.inference.session import providers_of_role

CLIPSEG_ROLES = ('image_encoder', 'text_encoder', 'decoder')


@pytest.fixture
def text_session(clip_folder: Path) -> Session:
    return Session(clip_folder / 'text_encoder.onnx', threads=1)


def text_feeds(batch: int, length: int) -> dict[str, Any]:
    ids = np.arange(batch * length, dtype=np.int64).reshape(batch, length) % 7
    return {'input_ids': ids, 'attention_mask': np.ones_like(ids)}


def test_runs_are_counted_and_warm_ups_are_not(text_session: Session) -> None:
    text_session.warm_up(['text_embedding'], text_feeds(1, 3))
    assert text_session.calls == 0
    (embedding,) = text_session.run(['text_embedding'], text_feeds(2, 5))
    assert embedding.shape == (2, 8)
    assert text_session.calls == 1


def test_only_the_outputs_asked_for_come_back(clipseg_folder: Path) -> None:
    session = Session(clipseg_folder / 'image_encoder.onnx', threads=1)
    feeds = {'pixel_values': np.zeros((1, 3, 32, 40), np.float32)}
    assert len(session.run(['coarse'], feeds)) == 1
    assert len(session.run(['coarse', 'fine'], feeds)) == 2


@pytest.mark.parametrize('providers', [(), ('TpuExecutionProvider',)])
def test_a_provider_that_is_not_there_lists_those_that_are(
    clip_folder: Path, providers: tuple[str, ...]
) -> None:
    with pytest.raises(ConfigurationError, match=r'has .*CPUExecutionProvider'):
        Session(clip_folder / 'text_encoder.onnx', providers=providers)


@pytest.mark.filterwarnings('ignore:Specified provider')
def test_a_provider_that_does_not_start_is_no_silent_fallback(
    clip_folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = clip_folder / 'text_encoder.onnx'
    monkeypatch.setattr('peace_ros.core.inference.session.check_providers', lambda providers: None)
    with pytest.raises(ConfigurationError, match='CUDAExecutionProvider did not start'):
        Session(path, providers=('CUDAExecutionProvider',))
    fallback = Session(path, providers=('CUDAExecutionProvider', 'CPUExecutionProvider'))
    assert fallback.providers == ('CPUExecutionProvider',)


def test_a_file_that_is_no_graph_is_named(tmp_path: Path) -> None:
    path = tmp_path / 'broken.onnx'
    path.write_bytes(b'not a graph')
    with pytest.raises(BundleError, match=r'broken\.onnx: ONNX Runtime'):
        Session(path)


def test_inputs_that_do_not_fit_are_named_with_their_shapes(text_session: Session) -> None:
    with pytest.raises(BundleError, match=r'input_ids.*\(1, 2\)'):
        text_session.run(['text_embedding'], {'input_ids': np.zeros((1, 2), np.int64)})


def test_a_whole_bundle_opens(clipseg_folder: Path) -> None:
    sessions = open_sessions(Bundle.load(clipseg_folder), CLIPSEG_ROLES, threads=1)
    assert set(sessions) == set(CLIPSEG_ROLES)


@pytest.mark.parametrize(
    ('family', 'renamed', 'says'),
    [
        ('clip', {'image_embedding': 'pixels'}, "no output 'image_embedding'"),
        ('clip', {'text_embedding': 'sentence'}, "no output 'text_embedding'"),
        ('clipseg', {'positive': 'yes'}, "no output 'positive'"),
        ('clipseg', {'coarse': 'rough'}, "no input 'rough'"),
    ],
)
def test_a_tensor_of_another_name_is_refused(
    tiny: Any, tmp_path: Path, family: str, renamed: dict[str, str], says: str
) -> None:
    bundle = Bundle.load(tiny.write_bundle(tmp_path / 'odd', family, output_names=renamed))
    roles = [role for role in bundle.paths if role != 'tokenizer']
    with pytest.raises(BundleError, match=says):
        open_sessions(bundle, roles, threads=1)


def test_an_embedding_width_that_differs_from_the_manifest_is_refused(
    tiny: Any, clip_folder: Path
) -> None:
    tiny.edit_manifest(clip_folder, embedding_width=9)
    with pytest.raises(BundleError, match=r'text_embedding tensor\(float\) \[B, 8\] must be'):
        open_sessions(Bundle.load(clip_folder), ('image_encoder', 'text_encoder'))


def test_an_input_size_that_differs_from_the_manifest_is_refused(
    tiny: Any, clipseg_folder: Path
) -> None:
    size = {'width': 64, 'height': 64, 'resize': 'stretch', 'mean': [0, 0, 0], 'std': [1, 1, 1]}
    tiny.edit_manifest(clipseg_folder, input=size)
    with pytest.raises(BundleError, match=r'\[1, 3, 32, 40\] must be .*\[1, 3, 64, 64\]'):
        open_sessions(Bundle.load(clipseg_folder), CLIPSEG_ROLES)


def test_the_encoder_of_another_bundle_does_not_pass_for_ours(tiny: Any, tmp_path: Path) -> None:
    ours = tiny.write_bundle(tmp_path / 'ours', 'clipseg')
    other = tiny.write_bundle(tmp_path / 'other', 'clip')
    (ours / 'image_encoder.onnx').write_bytes((other / 'image_encoder.onnx').read_bytes())
    tiny.resign(ours)
    with pytest.raises(BundleError, match='image_embedding'):
        open_sessions(Bundle.load(ours), CLIPSEG_ROLES)


@pytest.mark.parametrize(
    ('family', 'role', 'has_tensorrt'),
    [
        ('clipseg', 'image_encoder', True),
        ('clipseg', 'decoder', True),
        ('clipseg', 'text_encoder', False),
        ('fastsam', 'segmenter', True),
        ('fastsam', 'image_encoder', False),
    ],
)
def test_tensorrt_runs_only_networks_whose_inputs_keep_their_shape(
    family, role, has_tensorrt
) -> None:
    chosen = providers_of_role(family, role, (TENSORRT, CUDA))
    assert chosen == ((TENSORRT, CUDA) if has_tensorrt else (CUDA,))
    if not has_tensorrt:
        assert providers_of_role(family, role, (TENSORRT,)) == (CPU,)
