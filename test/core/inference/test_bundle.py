# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A bundle is loaded whole or refused with the file, the value and the remedy."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path
from typing import Any

import onnx
import pytest

from peace_ros.core.domain import BundleError
from peace_ros.core.inference import Bundle
from peace_ros.core.resources import models_dir


def read_manifest(folder: Path) -> dict[str, Any]:
    return json.loads((folder / 'manifest.json').read_text())


def test_a_whole_bundle_says_what_its_manifest_says(clipseg_folder: Path) -> None:
    bundle = Bundle.load(clipseg_folder)
    assert bundle.manifest.family == 'clipseg'
    assert (bundle.manifest.input.width, bundle.manifest.input.height) == (40, 32)
    assert bundle.manifest.recommended['threshold'] == 0.5
    assert bundle.paths['decoder'] == clipseg_folder / 'decoder.onnx'


def test_the_checksum_changes_with_any_file(tiny: Any, tmp_path: Path) -> None:
    same = [Bundle.load(tiny.write_bundle(tmp_path / name, 'clip')) for name in ('a', 'b')]
    other = Bundle.load(tiny.write_bundle(tmp_path / 'c', 'clip', seed=1))
    assert same[0].checksum == same[1].checksum != other.checksum


def test_an_unknown_name_lists_what_there_is(tmp_path: Path) -> None:
    with pytest.raises(BundleError, match=r"no model bundle 'clip-giant'.*shipped"):
        Bundle.load('clip-giant')
    for odd in ('', '../models/../nowhere', tmp_path / 'missing'):
        with pytest.raises(BundleError):
            Bundle.load(odd)


def test_a_folder_without_manifest_is_refused(tmp_path: Path) -> None:
    with pytest.raises(BundleError, match=r'manifest\.json: No such file'):
        Bundle.load(tmp_path)


@pytest.mark.parametrize('raw', [b'', b'{', b'\xff\xfe', b'[]', b'3'])
def test_a_manifest_that_is_no_object_is_refused(clip_folder: Path, raw: bytes) -> None:
    (clip_folder / 'manifest.json').write_bytes(raw)
    with pytest.raises(BundleError, match=r'manifest\.json'):
        Bundle.load(clip_folder)


def test_a_missing_file_is_named(clip_folder: Path) -> None:
    (clip_folder / 'tokenizer.json').unlink()
    with pytest.raises(BundleError, match=r'tokenizer\.json: No such file.*again'):
        Bundle.load(clip_folder)


def test_a_file_of_another_size_is_named_with_both_sizes(clip_folder: Path) -> None:
    path = clip_folder / 'image_encoder.onnx'
    size = path.stat().st_size
    path.write_bytes(path.read_bytes()[:-1])
    with pytest.raises(BundleError, match=rf'{size - 1} bytes where the manifest says {size}'):
        Bundle.load(clip_folder)


def test_one_flipped_bit_is_found(clip_folder: Path) -> None:
    path = clip_folder / 'image_encoder.onnx'
    raw = bytearray(path.read_bytes())
    raw[len(raw) // 2] ^= 1
    path.write_bytes(raw)
    with pytest.raises(BundleError, match=r'image_encoder\.onnx: SHA-256 [0-9a-f]{64}'):
        Bundle.load(clip_folder)


@pytest.mark.parametrize('name', ['w.bin', 'weights-' + 'x' * 200 + '.bin'])
def test_weights_outside_of_the_manifest_are_refused(clip_folder: Path, name: str) -> None:
    """They could be replaced while every checksum stays right."""
    path = clip_folder / 'image_encoder.onnx'
    model = onnx.load(path)
    tensor = model.graph.initializer[0]
    raw = onnx.numpy_helper.to_array(tensor).tobytes()
    tensor.ClearField('raw_data')
    tensor.ClearField('float_data')
    tensor.data_location = onnx.TensorProto.EXTERNAL
    for key, value in (('location', name), ('offset', '0'), ('length', str(len(raw)))):
        entry = tensor.external_data.add()
        entry.key, entry.value = key, value
    path.write_bytes(model.SerializeToString())
    (clip_folder / name).write_bytes(raw)
    _list_again(clip_folder, path.name)
    with pytest.raises(BundleError, match=rf"keeps weights in '{name}', which the manifest"):
        Bundle.load(clip_folder)
    _list_again(clip_folder, name)
    assert Bundle.load(clip_folder).manifest.files[name].bytes == len(raw)


def _list_again(folder: Path, name: str) -> None:
    raw, manifest = (folder / name).read_bytes(), folder / 'manifest.json'
    content = json.loads(manifest.read_text())
    content['files'][name] = {'sha256': hashlib.sha256(raw).hexdigest(), 'bytes': len(raw)}
    manifest.write_text(json.dumps(content))


WRONG = [
    ({'format': 2}, 'format is 2'),
    ({'format': True}, 'format'),
    ({'format': None}, "format is 'nothing'"),
    ({'family': 'sam'}, "family is 'sam'; known are clip, clipseg"),
    ({'name': ''}, 'name'),
    ({'embedding_width': 0}, 'embedding_width is 0'),
    ({'embedding_width': 8.0}, 'embedding_width'),
    ({'context_length': -1}, 'context_length'),
    ({'precision': 'fp4'}, 'precision'),
    ({'licence': None}, 'licence'),
    ({'provenance': 7}, 'provenance'),
    ({'roles': []}, 'roles'),
    ({'files': 'all'}, 'files'),
    ({'files': {'../secret': {'sha256': '0' * 64, 'bytes': 1}}}, 'without a folder'),
    ({'files': {'a.onnx': {'sha256': 'zz', 'bytes': 1}}}, 'sha256'),
    ({'files': {'a.onnx': 3}}, r'a\.onnx'),
    ({'recommended': {'threshold': 'high'}}, 'threshold'),
    ({'input': None}, 'input'),
]


@pytest.mark.parametrize(('changes', 'says'), WRONG)
def test_a_wrong_manifest_value_is_named(
    tiny: Any, clip_folder: Path, changes: dict[str, Any], says: str
) -> None:
    tiny.edit_manifest(clip_folder, **changes)
    with pytest.raises(BundleError, match=says):
        Bundle.load(clip_folder)


@pytest.mark.parametrize(
    ('key', 'value'),
    [
        ('width', 0),
        ('width', 100_000),
        ('height', '352'),
        ('resize', 'pad'),
        ('mean', [0.5, 0.5]),
        ('mean', [0.5, 0.5, None]),
        ('std', [0.2, 0.0, 0.2]),
        ('std', [0.2, float('nan'), 0.2]),
    ],
)
def test_a_wrong_input_value_is_named(
    tiny: Any, clip_folder: Path, key: str, value: object
) -> None:
    entry = read_manifest(clip_folder)['input'] | {key: value}
    tiny.edit_manifest(clip_folder, input=entry)
    with pytest.raises(BundleError, match=rf'input: {key}'):
        Bundle.load(clip_folder)


def test_a_missing_role_is_named(tiny: Any, clipseg_folder: Path) -> None:
    roles = read_manifest(clipseg_folder)['roles']
    tiny.edit_manifest(
        clipseg_folder, roles={role: name for role, name in roles.items() if role != 'decoder'}
    )
    with pytest.raises(BundleError, match='roles: decoder'):
        Bundle.load(clipseg_folder)


def test_a_role_whose_file_is_not_listed_is_refused(tiny: Any, clip_folder: Path) -> None:
    roles = read_manifest(clip_folder)['roles'] | {'tokenizer': 'other.json'}
    tiny.edit_manifest(clip_folder, roles=roles)
    with pytest.raises(BundleError, match=r'other\.json'):
        Bundle.load(clip_folder)


def test_an_unknown_role_is_refused(tiny: Any, clip_folder: Path) -> None:
    roles = read_manifest(clip_folder)['roles'] | {'oracle': 'tokenizer.json'}
    tiny.edit_manifest(clip_folder, roles=roles)
    with pytest.raises(BundleError, match='oracle unknown to family clip'):
        Bundle.load(clip_folder)


def test_a_segmenter_must_see_the_whole_frame(tiny: Any, tmp_path: Path) -> None:
    folder = tiny.write_bundle(tmp_path / 'cropped', 'clipseg', resize='crop')
    with pytest.raises(BundleError, match="resize is 'crop'"):
        Bundle.load(folder)


def test_a_bundle_of_another_family_is_refused(clip_folder: Path) -> None:
    with pytest.raises(BundleError, match="family is 'clip' where 'clipseg' is needed"):
        Bundle.load(clip_folder).require_family('clipseg')


def test_every_shipped_bundle_loads_by_name() -> None:
    for manifest in models_dir().glob('*/manifest.json'):
        assert Bundle.load(manifest.parent.name).manifest.name == manifest.parent.name
