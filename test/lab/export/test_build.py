# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What is exported equals its reference, or nothing is written."""

from __future__ import annotations

import errno
import json
import resource
import signal
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip('transformers')
pytest.importorskip('torch')

import onnx
from typer.testing import CliRunner

from peace_ros.cli.main import app
from peace_ros.core.domain import BundleError, Frame, Prompt
from peace_ros.core.inference import Bundle, ClipEncoder
from peace_ros.core.segmentation import ClipSegSegmenter, SegmentationParameters, Terms
from peace_ros.lab.export import build, sources, verify
from peace_ros.lab.export.build import build_bundle
from peace_ros.lab.export.random_models import random_clip, random_clipseg
from peace_ros.lab.export.sources import from_model, load_source

pytestmark = pytest.mark.export

TERMS = Terms(('grass', 'park'), ('road', 'car', 'water'))
PROMPT = Prompt('A rendered image of {term} in spring.', 0)


def layers_of(path: Path) -> set[str]:
    names = [node.name for node in onnx.load(str(path)).graph.node]
    return {name.split('layers.')[1].split('/')[0] for name in names if 'layers.' in name}


@pytest.mark.parametrize('refined', [False, True])
@pytest.mark.parametrize('reduce_dim', [16, 64])
def test_every_kind_of_clipseg_decoder_agrees(
    make_small_clipseg: Callable[..., Any], tmp_path: Path, refined: bool, reduce_dim: int
) -> None:
    model = make_small_clipseg(refined=refined, reduce_dim=reduce_dim)
    agreement = build_bundle(from_model('small', 'clipseg', model), tmp_path / 'small')
    assert agreement.difference < 1e-4
    assert agreement.iou > 0.999


def test_a_small_clip_agrees_in_every_precision(small_clip: Any, tmp_path: Path) -> None:
    source = from_model('small', 'clip', small_clip)
    for precision in ('fp32', 'fp16', 'int8'):
        agreement = build_bundle(source, tmp_path / precision, precision=precision)
        assert agreement.cosine > 0.999
        assert Bundle.load(tmp_path / precision).manifest.precision == precision


def test_layer_norm_and_softmax_stay_fp32_in_fp16(small_clip: Any, tmp_path: Path) -> None:
    build_bundle(from_model('small', 'clip', small_clip), tmp_path / 'half', precision='fp16')
    model = onnx.load(str(tmp_path / 'half' / 'image_encoder.onnx'))
    assert model.opset_import[0].version >= 17
    halves = {
        each.name for each in model.graph.initializer if each.data_type == onnx.TensorProto.FLOAT16
    }
    norms = [node for node in model.graph.node if node.op_type == 'LayerNormalization']
    assert len(norms) == 6
    assert not any(set(node.input) & halves for node in norms)
    assert halves


@pytest.mark.slow
def test_the_true_size_clipseg_runs_ten_of_twelve_layers_and_agrees(tmp_path: Path) -> None:
    model = random_clipseg('rd64')
    folder = tmp_path / 'clipseg-rd64'
    frames = sources_frames(1)
    agreement = build_bundle(from_model('rd64', 'clipseg', model), folder, frames=frames)
    assert agreement.difference <= verify.MOST_DIFFERENCE
    assert layers_of(folder / 'image_encoder.onnx') == {str(layer) for layer in range(10)}
    outputs = onnx.load(str(folder / 'image_encoder.onnx')).graph.output
    sizes = [[size.dim_value for size in each.type.tensor_type.shape.dim] for each in outputs]
    assert sizes == [[1, 485, 64]] * 3
    segmenter = ClipSegSegmenter(Bundle.load(folder), TERMS, SegmentationParameters(threads=2))
    segmenter.prepare(PROMPT)
    before = dict(segmenter.calls)
    heatmaps = [segmenter.segment(frame, PROMPT) for frame in (frames[0], frames[0])]
    calls = {role: segmenter.calls[role] - before[role] for role in before}
    assert calls == {'image_encoder': 2, 'text_encoder': 0, 'decoder': 2}
    assert heatmaps[0].safety.shape == (352, 352)
    assert heatmaps[0].safety.std() > 0.01


@pytest.mark.slow
def test_the_true_size_clip_agrees(tmp_path: Path) -> None:
    folder = tmp_path / 'clip-vit-b-32'
    source = from_model('clip', 'clip', random_clip('ViT-B/32'))
    agreement = build_bundle(source, folder, frames=sources_frames(1))
    assert agreement.difference <= verify.MOST_DIFFERENCE
    encoder = ClipEncoder(Bundle.load(folder), threads=2)
    assert encoder.image_embedding(sources_frames(1)[0]).shape == (512,)


def sources_frames(count: int) -> list[Frame]:
    return build.pictures.draw_pictures(count)


@pytest.mark.parametrize('photos', [0, 1, 5])
def test_int8_is_checked_on_pictures_that_were_not_measured(
    small_clip: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, photos: int
) -> None:
    measured: list[int] = []
    checked: list[int] = []

    class Watched(build.Quantiser):
        def __init__(self, source: Any, frames: Any, tokens: Any) -> None:
            measured.extend(hash(each.image_rgb.tobytes()) for each in frames)
            super().__init__(source, frames, tokens)

    def compare(source: Any, bundle: Any, frames: Any) -> Any:
        checked.extend(hash(each.image_rgb.tobytes()) for each in frames)
        return verify.compare(source, bundle, frames)

    monkeypatch.setattr(build, 'Quantiser', Watched)
    monkeypatch.setattr(build, 'compare', compare)
    frames = build.pictures.draw_pictures(photos, seed=9) or None
    source = from_model('small', 'clip', small_clip)
    build_bundle(source, tmp_path / 'clip', precision='int8', frames=frames)
    assert not set(measured) & set(checked)
    assert len(set(measured)) >= 12
    assert len(checked) == {0: 3, 1: 1, 5: 2}[photos]


def test_a_bundle_that_does_not_agree_leaves_the_old_one(
    small_clip: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = tmp_path / 'clip'
    source = from_model('small', 'clip', small_clip)
    build_bundle(source, folder)
    old = Bundle.load(folder).checksum
    poor = verify.ModelAgreement(0.5, 0.9, 1.0)
    monkeypatch.setattr(build, 'compare', lambda *_: poor)
    with pytest.raises(BundleError, match=r'does not agree .* difference at most 0\.001'):
        build_bundle(source, folder)
    assert Bundle.load(folder).checksum == old
    assert [each.name for each in tmp_path.iterdir()] == ['clip']


@pytest.mark.parametrize('lost', [0, 1])
def test_an_answer_of_no_number_on_any_picture_is_refused(
    small_clip: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, lost: int
) -> None:
    found = [verify.Answers(1e-6, 1.0), verify.Answers(1e-6, 1.0)]
    found[lost] = verify.Answers(float('nan'), float('nan'))
    monkeypatch.setattr(verify, '_compare_clip', lambda *_: found.pop(0))
    source = from_model('small', 'clip', small_clip)
    with pytest.raises(BundleError, match=r'small in fp16 answers with infinite numbers or NaN'):
        build_bundle(source, tmp_path / 'clip', precision='fp16', frames=sources_frames(2))
    assert not (tmp_path / 'clip').exists()


def test_masks_that_differ_are_refused_though_scores_agree() -> None:
    verify.ModelAgreement(0.1, 0.9999, 0.99, median_iou=0.985, mask_iou=0.9).refuse_if_poor(
        'int8', '-'
    )
    poor = verify.ModelAgreement(0.1, 0.9999, 0.99, median_iou=0.975, mask_iou=0.99)
    with pytest.raises(BundleError, match=r'median IoU 0\.975, .* median IoU at least 0\.98'):
        poor.refuse_if_poor('int8', 'CLIPSeg')


def test_masks_are_cut_at_the_median_of_all_pictures() -> None:
    rng = np.random.default_rng(5)
    varied = rng.uniform(0.0, 0.4, (40, 40))
    meadow = np.full((40, 40), 0.9)

    def noisy(scores: Any) -> Any:
        return scores + rng.normal(0.0, 1e-3, scores.shape)

    def judged(*pairs: tuple[Any, Any]) -> verify.ModelAgreement:
        return verify.agreement_of([verify.Answers(0.1, 0.9999, *pair) for pair in pairs])

    # Scores that stay below one half, yet lie elsewhere than they should.
    assert judged((np.roll(varied, 1), varied)).median_iou < 0.5
    assert judged((np.roll(varied, 1), varied)).mask_iou == 1.0
    # One that looks the same everywhere: noise, not an error of the bundle.
    judged((noisy(varied), varied), (noisy(meadow), meadow)).refuse_if_poor('int8', 'CLIPSeg')


def test_a_clipseg_is_judged_by_the_masks_of_its_pictures(
    make_small_clipseg: Callable[..., Any], tmp_path: Path
) -> None:
    source = from_model('small', 'clipseg', make_small_clipseg())
    build_bundle(source, tmp_path / 'small')
    frames = sources_frames(2)
    right = verify.compare(source, Bundle.load(tmp_path / 'small'), frames)
    assert right.median_iou > 0.99
    other = from_model('other', 'clipseg', make_small_clipseg(reduce_dim=64))
    wrong = verify.compare(other, Bundle.load(tmp_path / 'small'), frames)
    assert wrong.median_iou < 0.9
    figures = Bundle.load(tmp_path / 'small').manifest.verification
    assert {'iou', 'median_iou', 'mask_iou'} <= {*figures}


def test_a_full_disk_leaves_the_old_one(
    small_clip: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = tmp_path / 'clip'
    source = from_model('small', 'clip', small_clip)
    build_bundle(source, folder)

    def full(*_: Any, **__: Any) -> None:
        raise OSError(errno.ENOSPC, 'No space left on device')

    monkeypatch.setattr(build, 'write_manifest', full)
    with pytest.raises(BundleError, match=r'No space left on device; .* free some space'):
        build_bundle(source, folder)
    assert Bundle.load(folder)
    assert [each.name for each in tmp_path.iterdir()] == ['clip']


@pytest.mark.parametrize('room_bytes', [100_000, 5_000_000])
def test_a_file_that_cannot_be_finished_leaves_the_old_one(
    small_clip: Any, tmp_path: Path, room_bytes: int
) -> None:
    folder = tmp_path / 'clip'
    source = from_model('small', 'clip', small_clip)
    build_bundle(source, folder)
    old = Bundle.load(folder).checksum
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    before = signal.signal(signal.SIGXFSZ, signal.SIG_IGN)  # so that writing fails instead
    resource.setrlimit(resource.RLIMIT_FSIZE, (room_bytes, limits[1]))
    try:
        with pytest.raises(BundleError, match=r'; .* free some space or choose another folder'):
            build_bundle(source, folder)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
        signal.signal(signal.SIGXFSZ, before)
    assert Bundle.load(folder).checksum == old
    assert [each.name for each in tmp_path.iterdir()] == ['clip']


def test_what_cannot_be_written_to_is_said_before_space_is_freed_in_vain(
    small_clip: Any, tmp_path: Path
) -> None:
    (tmp_path / 'file').write_text('')
    with pytest.raises(BundleError, match=r'File exists; choose a folder that can be written'):
        build_bundle(from_model('small', 'clip', small_clip), tmp_path / 'file' / 'clip')


@pytest.mark.parametrize(
    ('options', 'told'),
    [
        ('--precision int4', "precision 'int4': choose one of fp32, fp16, int8"),
        ('--name ../up', '--name ../up: give a name'),
        ('--images nowhere', 'nowhere: no such folder; give a folder of photos'),
        ('', 'nowhere: no such file or folder; check the path'),
    ],
)
def test_the_command_refuses_in_one_line(tmp_path: Path, options: str, told: str) -> None:
    words = ['models', 'export', str(tmp_path / 'nowhere'), '--out', str(tmp_path / 'out')]
    done = CliRunner().invoke(app, [*words, *options.split()])
    assert done.exit_code == 2
    assert told in done.output
    assert len(done.output.splitlines()) == 1
    assert not list(tmp_path.iterdir())


def test_a_local_folder_is_a_source(small_clip: Any, tmp_path: Path) -> None:
    small_clip.save_pretrained(tmp_path / 'hub')
    source = load_source(str(tmp_path / 'hub'))
    assert source.family == 'clip'
    assert source.input.width == 64
    assert build_bundle(source, tmp_path / 'clip').cosine > 0.9999


def test_a_checkpoint_with_missing_weights_is_refused(small_clip: Any, tmp_path: Path) -> None:
    state = small_clip.state_dict()
    del state['visual_projection.weight']
    small_clip.save_pretrained(tmp_path / 'hub', state_dict=state)
    with pytest.raises(BundleError, match=r'1 weights are missing .*visual_projection'):
        load_source(str(tmp_path / 'hub'))


def test_weights_of_another_shape_are_refused(small_clip: Any, tmp_path: Path) -> None:
    small_clip.save_pretrained(tmp_path / 'hub')
    change_json(tmp_path / 'hub' / 'config.json', projection_dim=32)
    with pytest.raises(
        BundleError, match=r'and 2 are of another shape \(text_projection\.weight, '
    ):
        load_source(str(tmp_path / 'hub'))


@pytest.mark.parametrize(
    ('name', 'content', 'told'),
    [
        ('preprocessor_config.json', '{"size": ', r'cannot be read .*; download it again'),
        ('preprocessor_config.json', '[]', r'no JSON object; download it again'),
        (
            'preprocessor_config.json',
            '{"crop_size": "big"}',
            r"does \(.*'big'\); download it",
        ),
        ('preprocessor_config.json', '{"image_mean": [0.5]}', r'does \(.*\); download it again'),
        (
            'tokenizer.json',
            '{"version": ',
            r'tokenizer\.json: cannot be read .*; download it',
        ),
        ('vocab.json', '{"the": 1, ', r'vocab\.json: cannot be read .*; download it again'),
        (
            'config.json',
            '{"model_type": ',
            r'no model configuration .*; download its config\.json',
        ),
    ],
)
def test_a_truncated_or_odd_file_beside_the_weights_is_refused(
    small_clip: Any, tmp_path: Path, name: str, content: str, told: str
) -> None:
    small_clip.save_pretrained(tmp_path / 'hub')
    (tmp_path / 'hub' / name).write_text(content)
    with pytest.raises(BundleError, match=told):
        load_source(str(tmp_path / 'hub'))


def test_another_number_of_tokens_needs_a_tokenizer_of_its_own(
    small_clip: Any, tmp_path: Path
) -> None:
    state = small_clip.state_dict()
    words = 'text_model.embeddings.token_embedding.weight'
    state[words] = state[words][:-408]
    small_clip.save_pretrained(tmp_path / 'hub', state_dict=state)
    config = json.loads((tmp_path / 'hub' / 'config.json').read_text())
    text = config['text_config'] | {'vocab_size': 49000, 'eos_token_id': 48999}
    change_json(tmp_path / 'hub' / 'config.json', text_config=text)
    with pytest.raises(BundleError, match=r'knows 49000 tokens, .* 49408.*put its tokenizer\.json'):
        load_source(str(tmp_path / 'hub'))


def change_json(path: Path, **values: Any) -> None:
    path.write_text(json.dumps(json.loads(path.read_text()) | values))


@pytest.mark.parametrize('source', ['{}/none', '{}/none.pt', './none', 'none.safetensors', '~/no'])
def test_a_path_that_leads_nowhere_is_not_sought_on_the_network(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, source: str
) -> None:
    monkeypatch.setattr(sources.AutoConfig, 'from_pretrained', None)
    with pytest.raises(BundleError, match='no such file or folder; check the path'):
        load_source(source.format(tmp_path))


def test_what_is_neither_checkpoint_nor_folder_of_one_is_refused(tmp_path: Path) -> None:
    (tmp_path / 'photo.jpg').write_bytes(b'x')
    with pytest.raises(BundleError, match=r'no checkpoint by its name; .* ends in \.pt'):
        load_source(str(tmp_path / 'photo.jpg'))
    with pytest.raises(BundleError, match=r'no config\.json in it; give a folder'):
        load_source(str(tmp_path))


def test_a_folder_in_the_home_directory_is_a_source(
    small_clip: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    small_clip.save_pretrained(tmp_path / 'hub')
    monkeypatch.setenv('HOME', str(tmp_path))
    assert load_source('~/hub').name == 'hub'


def test_weights_for_which_the_disk_has_no_room_say_so(
    small_clip: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(*_: Any, **__: Any) -> None:
        raise OSError(errno.ENOSPC, 'No space left on device')

    small_clip.save_pretrained(tmp_path / 'hub')
    monkeypatch.setattr(sources.CLIPModel, 'from_pretrained', full)
    with pytest.raises(BundleError, match=r'No space left on device\); free some space'):
        load_source(str(tmp_path / 'hub'))


def test_a_truncated_checkpoint_is_refused(small_clip: Any, tmp_path: Path) -> None:
    small_clip.save_pretrained(tmp_path / 'hub')
    weights = tmp_path / 'hub' / 'model.safetensors'
    weights.write_bytes(weights.read_bytes()[:-1000])
    with pytest.raises(BundleError, match=r'its weights cannot be read .*; download them again'):
        load_source(str(tmp_path / 'hub'))


def test_another_family_is_refused(tmp_path: Path) -> None:
    (tmp_path / 'config.json').write_text('{"model_type": "bert"}')
    with pytest.raises(BundleError, match="of the family 'bert'; this exporter takes clip"):
        load_source(str(tmp_path))


def test_a_name_that_cannot_be_fetched_says_what_to_do(monkeypatch: pytest.MonkeyPatch) -> None:
    def offline(*_: Any, **__: Any) -> None:
        raise OSError('We could not connect to the hub')

    monkeypatch.setattr(sources.AutoConfig, 'from_pretrained', offline)
    with pytest.raises(BundleError, match=r'could not connect .* or give a folder'):
        load_source('someone/some-model')


def test_the_terms_of_a_random_network_differ() -> None:
    model = random_clipseg('rd16')
    torch = pytest.importorskip('torch')
    ids = torch.tensor([[49406, 320, 1125, 49407], [49406, 530, 518, 49407]])
    pixels = torch.randn(1, 3, 352, 352).expand(2, -1, -1, -1)
    with torch.inference_mode():
        logits = model(input_ids=ids, pixel_values=pixels).logits.numpy()
    assert np.abs(logits[0] - logits[1]).mean() > 0.05
