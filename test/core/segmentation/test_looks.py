# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Large frames are cut into parts that miss nothing, and what is seen there outweighs the whole."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from peace_ros.core.segmentation.looks import joined, parts_of

INPUT = (352, 352)


@pytest.mark.parametrize(
    ('image_wh', 'most', 'grid'),
    [
        ((352, 352), 10, (1, 1)),
        ((640, 480), 10, (2, 1)),
        ((640, 360), 10, (2, 1)),
        ((360, 640), 10, (1, 2)),
        ((640, 360), 2, (1, 1)),
        ((630, 360), 10, (1, 1)),
        ((640, 520), 10, (1, 1)),
        ((704, 704), 10, (2, 2)),
        ((1056, 1056), 10, (3, 3)),
        ((1056, 1056), 9, (2, 3)),
        ((1280, 720), 10, (3, 2)),
        ((1920, 1080), 10, (4, 2)),
        ((4000, 400), 10, (9, 1)),
        ((1056, 1056), 2, (1, 1)),
        ((1056, 1056), 1, (1, 1)),
    ],
)
def test_a_frame_is_cut_as_finely_as_its_pixels_and_the_limit_allow(
    image_wh: tuple[int, int], most: int, grid: tuple[int, int]
) -> None:
    columns, rows = grid
    parts = parts_of(image_wh, INPUT, most)
    assert len(parts) == (columns * rows if columns * rows > 1 else 0)
    if parts:
        assert len({part.own_columns.start for part in parts}) == columns
        assert len({part.own_rows.start for part in parts}) == rows


def test_the_sharper_direction_gives_up_a_part_whatever_the_input() -> None:
    parts = parts_of((1600, 800), (400, 200), 13)  # of 4 x 4 as sharp either way
    assert len({part.own_columns.start for part in parts}) == 3
    assert len({part.own_rows.start for part in parts}) == 4


@given(st.integers(1, 5000), st.integers(1, 5000), st.integers(1, 101))
def test_parts_share_the_frame_among_them_and_none_is_enlarged_much(
    width: int, height: int, most: int
) -> None:
    parts = parts_of((width, height), INPUT, most)
    assert len(parts) <= max(0, most - 1)
    if not parts:
        return
    assert (
        sum(
            (part.own_rows.stop - part.own_rows.start)
            * (part.own_columns.stop - part.own_columns.start)
            for part in parts
        )
        == width * height
    )
    for part in parts:
        for seen, own, length in (
            (part.rows, part.own_rows, height),
            (part.columns, part.own_columns, width),
        ):
            assert 0 <= seen.start <= own.start < own.stop <= seen.stop <= length
            assert own.stop - own.start == length or own.stop - own.start >= 316


def test_what_parts_answer_lies_where_they_lie() -> None:
    """A network that tells the brightness of what it sees, in cells of 8 px."""
    rng = np.random.default_rng(3)
    cells = rng.uniform(0.1, 0.9, (12, 16)).astype(np.float32)
    image = np.kron(cells, np.ones((64, 64), np.float32))
    parts = parts_of((1024, 768), (128, 128), 50)
    assert len(parts) == 48

    def see(seen: np.ndarray) -> np.ndarray:
        rows = np.linspace(0, seen.shape[0], 33).astype(int)[:-1]
        columns = np.linspace(0, seen.shape[1], 33).astype(int)[:-1]
        sums = np.add.reduceat(np.add.reduceat(seen, rows, 0), columns, 1)
        areas = np.outer(np.diff([*rows, seen.shape[0]]), np.diff([*columns, seen.shape[1]]))
        return np.asarray(sums / areas, np.float32)

    answers = [see(image[part.rows, part.columns]) for part in parts]
    found = joined(see(image), answers, parts)
    assert found.shape == (6 * 32, 8 * 32)
    cell_px = 16
    middle = slice(cell_px // 4, 3 * cell_px // 4)
    for row in range(12):
        for column in range(16):
            block = found[row * cell_px :, column * cell_px :][middle, middle]
            assert block.mean() == pytest.approx(cells[row, column], abs=0.08)


def test_a_part_sees_a_twentieth_more_on_each_side_within_the_frame() -> None:
    parts = parts_of((800, 400), (200, 200), 50)
    assert len(parts) == 8
    second = parts[1]
    assert (second.rows, second.columns) == (slice(0, 210), slice(190, 410))
    assert (second.own_rows, second.own_columns) == (slice(0, 200), slice(200, 400))
    last = parts[7]
    assert (last.rows, last.columns) == (slice(190, 400), slice(590, 800))


def test_a_part_is_cut_out_contiguously() -> None:
    image = np.arange(400 * 800 * 3, dtype=np.uint32).astype(np.uint8).reshape(400, 800, 3)
    part = parts_of((800, 400), (200, 200), 50)[6]
    seen = part.of(image)
    assert seen.flags.c_contiguous
    assert np.array_equal(seen, image[190:400, 390:610])


@pytest.mark.parametrize('axis', [0, 1])
def test_a_ramp_over_the_frame_stays_a_ramp_over_the_parts(axis: int) -> None:
    """To a thirtieth of a cell, in which OpenCV counts."""
    length, cells = (800, 400)[axis], 4

    def ramp(start: float, stop: float, count: int) -> np.ndarray:
        centres = start + (np.arange(count) + 0.5) / count * (stop - start)
        line = (0.2 + 0.6 * centres / length).astype(np.float32)
        square = np.tile(line, (count, 1))
        return square if axis == 0 else np.ascontiguousarray(square.T)

    parts = parts_of((800, 400), (200, 200), 50)
    seen = [(part.columns, part.rows)[axis] for part in parts]
    answers = [ramp(each.start, each.stop, cells) for each in seen]
    found = joined(ramp(0, length, cells), answers, parts).astype(float)
    assert found.shape == (2 * cells, 4 * cells)
    count = found.shape[1 - axis]
    without_caution = 1 / (1 + np.exp(-np.log(found / (1 - found)) - 0.15))
    got = without_caution if axis == 0 else without_caution.T
    expected = 0.2 + 0.6 * (np.arange(count) + 0.5) / count
    inside = slice(3, -3)  # where the whole frame's own answer is a ramp too
    assert np.allclose(got[:, inside], expected[inside], atol=0.003)


def test_each_part_needs_an_answer() -> None:
    parts = parts_of((704, 704), INPUT, 10)
    whole = np.full((4, 4), 0.5, np.float32)
    with pytest.raises(ValueError, match='zip'):
        joined(whole, [whole] * 3, parts)


def test_a_person_seen_closely_outweighs_a_whole_that_shows_lawn() -> None:
    parts = parts_of((704, 704), INPUT, 10)
    whole = np.full((8, 8), 0.95, np.float32)
    answers = [np.full((8, 8), 0.95, np.float32) for _ in parts]
    answers[3][4:6, 4:6] = 0.02
    found = joined(whole, answers, parts)
    assert found.shape == (16, 16)
    assert 0.93 < found[:8].min() < 0.95  # a little caution
    assert found[12:14, 12:14].min() < 0.1


def test_scores_of_zero_and_one_stay_scores() -> None:
    parts = parts_of((704, 704), INPUT, 10)
    for far, near in ((0.0, 1.0), (1.0, 0.0), (1.0, 1.0), (0.0, 0.0)):
        found = joined(
            np.full((4, 4), far, np.float32), [np.full((4, 4), near, np.float32)] * 4, parts
        )
        assert found.dtype == np.float32
        assert np.allclose(found, near, atol=1e-3)


def test_a_whole_without_parts_is_itself() -> None:
    whole = np.array([[0.25, 0.5]], np.float32)
    assert joined(whole, [], ()) is whole
