# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The cores of a configuration, put together, over pictures and sequences."""

from __future__ import annotations

import subprocess
import sys

import cv2
import numpy as np
import pytest

import peace_ros
from peace_ros.core.domain import Camera, ConfigurationError, Frame, ImageError
from peace_ros.core.images import read_image
from peace_ros.core.pipeline import Pipeline, create_generator, create_landing, segmentation_of
from peace_ros.core.presets import load_preset
from peace_ros.core.prompting import PromptingParameters
from peace_ros.core.segmentation import ClipSegParameters
from peace_ros.simulation.drawing import draw_scene


@pytest.fixture(scope='module')
def pipeline() -> Pipeline:
    return Pipeline.from_preset('peace_cs', threads=1)


@pytest.fixture(scope='module')
def picture() -> np.ndarray:
    return draw_scene(5, 352, 0.25).image_rgb


def test_a_picture_becomes_a_heatmap_whatever_came_before(pipeline, picture) -> None:
    first = pipeline.segment(picture).safety
    wide = pipeline.segment(picture[:200])
    pipeline.look(Frame(255 - picture, 5))
    np.testing.assert_array_equal(pipeline.segment(picture).safety, first)
    assert first.shape == (352, 352)
    assert first.std() > 0.05
    assert wide.stamp_ns == 0


def test_a_frame_of_a_sequence_keeps_its_stamp_and_gets_a_prompt(pipeline, picture) -> None:
    pipeline.reset()
    look = pipeline.look(Frame(picture, 77))
    assert look.heatmap.stamp_ns == look.prompt.stamp_ns == look.frame.stamp_ns == 77
    assert set(look.prompt.ranking) == {'resolution', 'frame', 'environment'}


def test_what_no_working_camera_gives_is_refused(pipeline, picture) -> None:
    with pytest.raises(ImageError, match='of one colour'):
        pipeline.segment(np.full_like(picture, 120))
    pipeline.reset()
    pipeline.look(Frame(picture, 1))
    with pytest.raises(ImageError, match='its sides'):
        pipeline.look(Frame(np.ascontiguousarray(picture[:200]), 2))


def test_without_a_generator_a_prompt_is_asked_for(pipeline, picture) -> None:
    alone = Pipeline(pipeline.segmenter)
    with pytest.raises(ConfigurationError, match='prompt generator'):
        alone.look(Frame(picture, 1))
    prompt = pipeline.prompt(Frame(picture, 1))
    assert alone.heatmap(Frame(picture, 1), prompt).stamp_ns == 1


def test_text_embeddings_are_kept_where_the_parameters_say(tmp_path) -> None:
    create_generator(PromptingParameters(cache_dir=str(tmp_path), threads=1))
    assert list(tmp_path.rglob('*.npz'))


def test_a_static_template_needs_no_model() -> None:
    generator = create_generator(PromptingParameters(template='DD', bundle='nowhere'))
    assert generator.generate(Frame(np.zeros((8, 8, 3), np.uint8), 4)).stamp_ns == 4


def test_a_preset_gives_the_parameters_of_its_family_and_what_is_given_goes_before() -> None:
    common, own = segmentation_of(load_preset('d_fs'), threads=1, fastsam_max_segments=7)
    assert (common.family, common.threads, common.fusion) == ('fastsam', 1, 'softmax')
    assert (own.fastsam_max_overlap, own.fastsam_max_segments) == (0.6, 7)
    assert segmentation_of(load_preset('d_cs'))[1] == ClipSegParameters()


def test_the_landing_takes_its_parameters_from_the_preset(tmp_path) -> None:
    path = tmp_path / 'mine.yaml'
    path.write_text('landing: {ros__parameters: {map_size_m: 100.0}}\n')
    landing = create_landing(load_preset(path), Camera.from_degrees(352, 352, 73.0))
    assert landing.safety_map.parameters.map_size_m == 100.0


def test_a_photo_is_read_as_rgb(tmp_path) -> None:
    red = np.zeros((6, 9, 3), np.uint8)
    red[..., 0] = 200
    cv2.imwrite(str(tmp_path / 'a.png'), red[..., ::-1])
    np.testing.assert_array_equal(read_image(tmp_path / 'a.png'), red)
    (tmp_path / 'a.jpg').write_bytes(b'nothing')
    for name, says in (('a.jpg', 'neither JPEG nor PNG'), ('b.png', 'No such file')):
        with pytest.raises(ImageError, match=says) as caught:
            read_image(tmp_path / name)
        assert name in str(caught.value)


def test_the_package_offers_the_pipeline_and_loads_no_model_library_for_its_version() -> None:
    assert peace_ros.Pipeline is Pipeline
    assert peace_ros.read_image is read_image
    assert {'Pipeline', 'read_image', 'draw_overlay'} <= set(dir(peace_ros))
    with pytest.raises(AttributeError, match='no attribute'):
        _ = peace_ros.Pipelin
    program = (
        'import sys, peace_ros; print(peace_ros.__version__);'
        "sys.exit('numpy' in sys.modules or 'onnxruntime' in sys.modules)"
    )
    subprocess.run([sys.executable, '-c', program], check=True)
