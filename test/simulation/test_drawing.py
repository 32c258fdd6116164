# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

from math import pi

import cv2
import numpy as np
import pytest

from peace_ros.core.domain import Label, WorldError
from peace_ros.simulation.drawing import (
    CONDITIONS,
    LAYOUTS,
    SEASONS,
    apply_condition,
    draw_scene,
)
from peace_ros.simulation.drawing.canvas import Canvas
from peace_ros.simulation.drawing.light import Sun
from peace_ros.simulation.drawing.palette import Palette
from peace_ros.simulation.drawing.plan import Building, Plan, Thing, Warp
from peace_ros.simulation.drawing.scene import Look, render
from peace_ros.simulation.drawing.sprites import stamp_thing
from peace_ros.simulation.drawing.window import DrawnWindow

PLAIN = Look((1.0, 1.0, 1.0), 1.0, 1.0, 0.0, 0.0, 0.0, 0.4)
NOON = Sun(0.3, 0.7, 1.0)
EVERYTHING = frozenset(Label) - {Label.UNLABELED}


def lawn() -> Plan:
    palette = Palette(np.random.default_rng(1), 'summer')
    return Plan(Warp(0.0), palette.material('lawn'))


def window(size_m: float, gsd_m: float) -> DrawnWindow:
    count = round(size_m / gsd_m)
    return DrawnWindow(-size_m / 2, -size_m / 2, count, count, gsd_m)


def test_every_layout_is_drawn_however_small_the_piece_of_ground():
    for layout in LAYOUTS:
        for seed in range(8):
            assert draw_scene(seed, 64, 0.05, layout=layout).labels.shape == (64, 64)


def test_a_scene_has_the_asked_shape_and_every_pixel_a_class():
    scene = draw_scene(7, 200, 0.2, season='autumn', layout='suburb')
    assert scene.image_rgb.shape == (200, 200, 3)
    assert scene.image_rgb.dtype == np.uint8
    assert scene.labels.shape == (200, 200)
    assert scene.labels.dtype == np.uint8
    assert (scene.season, scene.layout, scene.gsd_m) == ('autumn', 'suburb', 0.2)
    assert set(np.unique(scene.labels).tolist()) <= EVERYTHING


def test_the_same_seed_draws_the_same_scene():
    first, second, other = (draw_scene(s, 176, 0.3) for s in (11, 11, 12))
    assert np.array_equal(first.image_rgb, second.image_rgb)
    assert np.array_equal(first.labels, second.labels)
    assert not np.array_equal(first.image_rgb, other.image_rgb)


def test_resolution_changes_only_resolution():
    fine, coarse = draw_scene(21, 512, 0.1), draw_scene(21, 256, 0.2)
    assert fine.layout == coarse.layout
    reduced = cv2.resize(fine.image_rgb, (256, 256), interpolation=cv2.INTER_AREA).astype(float)
    tone_fine = cv2.blur(reduced, (9, 9))
    tone_coarse = cv2.blur(coarse.image_rgb.astype(float), (9, 9))
    assert np.abs(tone_fine - tone_coarse).mean() < 4.0
    assert (fine.labels[::2, ::2] == coarse.labels).mean() > 0.96


def test_scenes_of_all_layouts_together_show_all_classes_often():
    shares = np.zeros(len(Label))
    present = np.zeros(len(Label))
    count = 0
    for seed in range(2):
        for number, layout in enumerate(LAYOUTS):
            scene = draw_scene(50 + 8 * seed + number, 256, 0.4, layout=layout)
            share = np.bincount(scene.labels.ravel(), minlength=len(Label)) / scene.labels.size
            shares += share
            present += share > 0
            count += 1
    shares, present = shares / count, present / count
    assert shares[[Label.GRASS, Label.BARE_GROUND]].sum() > 0.3
    assert shares[Label.PERSON] > 1e-4
    for label in EVERYTHING:
        assert present[label] >= 0.2, f'{label.name} is rare'
    assert present[Label.PERSON] > 0.8
    assert present[Label.VEHICLE] > 0.7


@pytest.mark.parametrize('season', SEASONS)
def test_every_season_draws_every_layout(season):
    for number, layout in enumerate(LAYOUTS):
        scene = draw_scene(number, 96, 0.45, season=season, layout=layout)
        assert np.unique(scene.labels).size >= 2
        assert scene.image_rgb.std() > 3.0


@pytest.mark.parametrize('gsd_m', [0.05, 0.1, 0.2, 0.4])
@pytest.mark.parametrize('heading_rad', [0.0, 0.6])
def test_a_car_covers_its_own_area_at_every_resolution(gsd_m, heading_rad):
    plan = lawn()
    plan.put(Thing('car', 0.4, -0.3, heading_rad, 4.5, 1.8, (200.0, 40.0, 40.0), Label.VEHICLE))
    canvas = render(plan, window(16.0, gsd_m), 1, NOON, PLAIN)
    car = canvas.labels == Label.VEHICLE
    assert car.sum() * gsd_m**2 == pytest.approx(4.5 * 1.8, rel=0.12)
    rows, columns = np.nonzero(car)
    points = np.stack([columns, rows], axis=1).astype(np.float32)
    sides = sorted(cv2.minAreaRect(points)[1])
    assert sides[1] * gsd_m == pytest.approx(4.5, abs=1.2 * gsd_m + 0.1)
    assert sides[0] * gsd_m == pytest.approx(1.8, abs=1.2 * gsd_m + 0.1)


@pytest.mark.parametrize('gsd_m', [0.05, 0.1, 0.2, 0.45])
def test_a_person_is_half_a_metre_and_never_vanishes(gsd_m):
    plan = lawn()
    for k in range(8):
        plan.put(
            Thing(
                'person',
                -10.0 + 2.83 * k,
                0.37 * k,
                0.8 * k,
                0.55,
                0.55,
                (30.0, 30.0, 60.0),
                Label.PERSON,
            )
        )
    canvas = render(plan, window(30.0, gsd_m), 1, NOON, PLAIN)
    count, _ = cv2.connectedComponents((canvas.labels == Label.PERSON).astype(np.uint8))
    assert count - 1 == 8
    area = (canvas.labels == Label.PERSON).sum() * gsd_m**2 / 8
    assert 0.06 < area < max(0.3, 2.5 * gsd_m**2)


@pytest.mark.parametrize('gsd_m', [0.1, 0.3])
@pytest.mark.parametrize('roof', ['gable', 'hip', 'flat', 'metal', 'plain', 'saw'])
def test_a_building_is_true_to_size_under_every_roof(gsd_m, roof):
    plan = lawn()
    plan.put(Building(1.0, 2.0, 14.0, 9.0, 0.5, 5.0, roof, (170.0, 100.0, 80.0), 3))
    canvas = render(plan, window(40.0, gsd_m), 1, NOON, PLAIN)
    assert (canvas.labels == Label.BUILDING).sum() * gsd_m**2 == pytest.approx(126.0, rel=0.03)


def test_a_pitched_roof_is_brighter_on_the_side_of_the_sun():
    plan = lawn()
    plan.put(Building(0.0, 0.0, 14.0, 9.0, 0.0, 5.0, 'gable', (150.0, 100.0, 80.0), 5))
    sun = Sun(pi / 2, 0.7, 1.0)  # towards the bottom of the image
    canvas = render(plan, window(30.0, 0.2), 1, sun, PLAIN)
    lit = canvas.rgb[75:90, 60:90].mean()
    shaded = canvas.rgb[58:72, 60:90].mean()
    assert lit > 1.2 * shaded


def test_shadows_fall_away_from_the_sun_as_long_as_the_sun_is_low():
    plan = lawn()
    plan.put(Building(0.0, 0.0, 10.0, 10.0, 0.0, 8.0, 'plain', (200.0, 200.0, 200.0), 3))
    plain = render(plan, window(60.0, 0.2), 1, Sun(0.0, pi / 4, 0.0), PLAIN).rgb
    sunny = render(plan, window(60.0, 0.2), 1, Sun(0.0, pi / 4, 1.0), PLAIN).rgb
    dark = (sunny.mean(axis=2) < 0.75 * plain.mean(axis=2)) & (np.arange(300) < 120)[None, :]
    columns = np.nonzero(dark[150])[0]
    # The sun stands to the right at 45 degrees: 8 m of shadow to the left of the wall at -5 m.
    assert columns.min() * 0.2 - 30.0 == pytest.approx(-13.0, abs=0.6)
    assert not (sunny.mean(axis=2) < 0.75 * plain.mean(axis=2))[150, 180:].any()


def test_shadows_do_not_change_labels():
    plan = lawn()
    plan.put(Building(-6.0, 0.0, 10.0, 10.0, 0.2, 12.0, 'flat', (200.0, 200.0, 200.0), 3))
    plan.tree(8.0, 3.0, 7.0, 9.0, (60.0, 90.0, 50.0), 'leafy')
    labels = [
        render(plan, window(60.0, 0.25), 1, Sun(azimuth, elevation, clear), PLAIN).labels
        for azimuth, elevation, clear in [(0.0, 0.3, 1.0), (2.0, 0.9, 1.0), (4.0, 0.5, 0.0)]
    ]
    assert np.array_equal(labels[0], labels[1])
    assert np.array_equal(labels[0], labels[2])
    assert (labels[0] == Label.TREE).sum() * 0.25**2 == pytest.approx(pi * 3.0**2, rel=0.35)


def test_ground_texture_is_no_flat_colour_at_any_scale():
    canvas = render(lawn(), window(70.0, 0.1), 1, NOON, PLAIN)
    grey = canvas.rgb.mean(axis=2)
    for size in (1, 8, 40):
        averaged = cv2.resize(grey, None, fx=1 / size, fy=1 / size, interpolation=cv2.INTER_AREA)
        assert averaged.std() > 1.0


@pytest.mark.parametrize('name', CONDITIONS)
def test_every_condition_gives_an_image_and_leaves_its_input_alone(name):
    scene = draw_scene(4, 128, 0.3, layout='park')
    before = scene.image_rgb.copy()
    rng = np.random.default_rng(2)
    changed = apply_condition(scene.image_rgb, name, rng, strength=0.8, labels=scene.labels)
    assert changed.shape == before.shape
    assert changed.dtype == np.uint8
    assert np.array_equal(scene.image_rgb, before)
    difference = np.abs(changed.astype(float) - before).mean()
    assert (difference == 0.0) if name == 'clear' else (difference > 2.0)
    again = apply_condition(
        scene.image_rgb, name, np.random.default_rng(2), strength=0.8, labels=scene.labels
    )
    assert np.array_equal(changed, again)


def test_conditions_look_like_their_words():
    scene = draw_scene(9, 176, 0.3, season='summer', layout='suburb')
    image, labels = scene.image_rgb, scene.labels

    def under(name: str) -> np.ndarray:
        rng = np.random.default_rng(1)
        return apply_condition(image, name, rng, strength=0.9, labels=labels).astype(float)

    def sharpness(picture: np.ndarray) -> float:
        return float(cv2.Laplacian(picture.mean(axis=2), cv2.CV_64F).std())

    grass = labels == Label.GRASS
    assert under('snowy')[grass].mean() > image[grass].mean() + 40
    assert under('night').mean() < 0.4 * image.mean()
    assert under('fog').std() < 0.5 * image.std()
    assert sharpness(under('blurred')) < 0.4 * sharpness(image.astype(float))
    assert sharpness(under('noise')) > 1.2 * sharpness(image.astype(float))
    evening = under('evening')
    assert evening[..., 0].mean() / evening[..., 2].mean() > image[..., 0].mean() / (
        image[..., 2].mean()
    )


@pytest.mark.parametrize(
    ('arguments', 'said'),
    [
        ({'seed': -1}, 'seed -1'),
        ({'size_px': 4}, '16 to 8192'),
        ({'gsd_m': 5.0}, '0.02 to 2'),
        ({'season': 'monsoon'}, 'monsoon'),
        ({'layout': 'moon'}, 'moon'),
    ],
)
def test_scenes_out_of_range_are_refused(arguments, said):
    with pytest.raises(WorldError, match=said):
        draw_scene(**{'seed': 1, 'size_px': 64, 'gsd_m': 0.2, **arguments})


def test_unknown_condition_is_refused():
    with pytest.raises(WorldError, match='hail'):
        apply_condition(np.zeros((8, 8, 3), np.uint8), 'hail', np.random.default_rng(1))


def test_a_thing_outside_of_the_picture_leaves_no_label_at_its_edge():
    window = DrawnWindow(left_m=0.0, top_m=0.0, width_px=40, height_px=40, gsd_m=0.05)
    canvas = Canvas(window, seed=1)
    # Its circle touches the picture, none of its opaque pixels do.
    thing = Thing('person', 2.3, 1.0, pi / 2, 0.45, 0.3, (200.0, 30.0, 30.0), Label.PERSON)
    stamp_thing(canvas, thing)
    assert not (canvas.labels == Label.PERSON).any()
