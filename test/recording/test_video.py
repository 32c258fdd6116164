# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Videos: frames at their own times, an assumed altitude, and overlays that are whole or absent."""

from __future__ import annotations

import resource
from fractions import Fraction
from pathlib import Path

import av
import numpy as np
import pytest

from peace_ros.core.domain import RecordingError
from peace_ros.recording import AltitudeProfile, VideoReader, VideoWriter
from peace_ros.recording import video as video_module

SIZE_PX = (96, 64)


def picture(number: int) -> np.ndarray:
    width, height = SIZE_PX
    rgb = np.full((height, width, 3), (8 * number, 60, 200 - 6 * number), np.uint8)
    rgb[: height // 2, : width // 2] = 255  # the corner that is up and left
    return rgb


def write_video(
    path: Path,
    codec='libx264',
    *,
    times_ms=None,
    rate=10,
    turn_deg=0,
    options=None,
    options_of_codec=None,
    **stream_is,
) -> Path:
    times_ms = [100 * k for k in range(24)] if times_ms is None else times_ms
    with av.open(str(path), 'w', options=options or {}) as container:
        stream = container.add_stream(codec, rate=rate)
        stream.width, stream.height = SIZE_PX
        stream.pix_fmt = 'yuv420p'
        for name, value in stream_is.items():
            setattr(stream, name, value)
        if codec != 'mpeg4':
            stream.codec_context.time_base = stream.time_base = Fraction(1, 1000)
        stream.codec_context.options = options_of_codec or {}
        if turn_deg:
            stream.set_display_rotation(turn_deg)
        for number, time_ms in enumerate(times_ms):
            frame = av.VideoFrame.from_ndarray(picture(number), format='rgb24')
            if codec != 'mpeg4':
                frame.pts, frame.time_base = time_ms, Fraction(1, 1000)
            for packet in stream.encode(frame):
                container.mux(packet)
        for packet in stream.encode():
            container.mux(packet)
    return path


def times_s(path: Path) -> list[float]:
    pictures = list(VideoReader(path).pictures())
    assert not [each.fault for each in pictures if each.fault]
    return [round(each.stamp_ns * 1e-9 - 1.0, 3) for each in pictures]


@pytest.mark.parametrize(
    ('name', 'codec', 'options'),
    [
        ('a.mp4', 'libx264', {}),
        ('fragments.mp4', 'libx264', {'movflags': 'frag_keyframe+empty_moov'}),
        ('live.mkv', 'libx264', {'live': '1'}),
        ('live.webm', 'libvpx-vp9', {'live': '1'}),
        ('a.ts', 'libx264', {}),
        ('a.mov', 'libx265', {}),
        ('a.avi', 'mpeg4', {}),
        ('av1.mp4', 'libsvtav1', {}),
    ],
)
def test_frames_are_counted_and_timed_by_reading(tmp_path, name, codec, options) -> None:
    path = write_video(tmp_path / name, codec, options=options)
    reader = VideoReader(path)
    pictures = list(reader.pictures())
    assert reader.count == len(pictures) == 24
    assert times_s(path) == [round(0.1 * k, 3) for k in range(24)]
    reds = [each.rgb[-10:, -10:, 0].mean() for each in pictures]
    assert reds == sorted(reds)
    assert reader.remarks == []
    assert reader.frame_hz == pytest.approx(10.0)


def test_a_variable_frame_rate_keeps_its_times(tmp_path) -> None:
    times_ms = [33 * k for k in range(12)] + [400 + 1000 * k for k in range(12)]
    path = write_video(tmp_path / 'a.mp4', times_ms=times_ms)
    assert times_s(path) == [each / 1000 for each in times_ms]


@pytest.mark.parametrize(('turn_deg', 'corner'), [(90, (1, 0)), (180, (1, 1)), (-90, (0, 1))])
def test_a_turned_picture_is_put_upright_and_told(tmp_path, turn_deg, corner) -> None:
    reader = VideoReader(write_video(tmp_path / 'a.mp4', turn_deg=turn_deg))
    rgb = next(reader.pictures()).rgb
    down, right = corner
    assert rgb[-5 if down else 5, -5 if right else 5].min() > 200
    assert rgb[5 if down else -5, 5 if right else -5].min() < 100
    (remark,) = reader.remarks
    assert f'turned by {turn_deg % 360} deg' in remark


def test_what_follows_a_damaged_frame_is_left_out_up_to_the_next_key_frame(tmp_path) -> None:
    no_cuts = {'sc_threshold': '0'}
    path = write_video(tmp_path / 'a.mp4', gop_size=8, max_b_frames=0, options_of_codec=no_cuts)
    with av.open(str(path)) as container:
        packets = [each for each in container.demux(video=0) if each.size]
        at, size = packets[10].pos, packets[10].size
    data = bytearray(path.read_bytes())
    data[at + 5 : at + size] = bytes(255 - each for each in data[at + 5 : at + size])
    path.write_bytes(data)
    reader = VideoReader(path)
    pictures = list(reader.pictures())
    usable = {round((each.stamp_ns * 1e-9 - 1.0) * 10) for each in pictures if not each.fault}
    assert usable == {*range(10), *range(16, 24)}
    assert 'places of the video cannot be decoded; the last: h264' in reader.remarks[0]
    assert all('h264' in each.fault for each in pictures if each.rgb is None)


@pytest.mark.parametrize('name', ['a.mkv', 'a.ts'])
def test_a_file_that_is_cut_short_is_read_up_to_the_cut(tmp_path, name) -> None:
    times_ms = [500 * k for k in range(24)]
    path = write_video(tmp_path / name, times_ms=times_ms, gop_size=4)
    path.write_bytes(path.read_bytes()[: path.stat().st_size * 4 // 5])
    reader = VideoReader(path)
    pictures = list(reader.pictures())
    assert 1 < len(pictures) < 24
    if name == 'a.mkv':  # a transport stream announces nothing
        assert 'cut short' in reader.remarks[0]


def test_a_codec_that_cannot_be_decoded_is_a_sentence(tmp_path) -> None:
    path = write_video(tmp_path / 'a.mp4')
    path.write_bytes(path.read_bytes().replace(b'avc1', b'zzzz'))
    with pytest.raises(RecordingError, match='cannot decode its codec: convert it to H'):
        VideoReader(path)


def test_damaged_times_and_sizes_are_refused(tmp_path, monkeypatch) -> None:
    path = write_video(tmp_path / 'a.mkv', times_ms=[0, 50_000_000])
    with pytest.raises(RecordingError, match=r'span 13.9 h, the limit is 12 h'):
        VideoReader(path)
    monkeypatch.setattr(video_module, 'MAX_PIXELS', 1000)
    with pytest.raises(RecordingError, match='96 x 64 px: the limit is 1000 pixels'):
        VideoReader(write_video(tmp_path / 'b.mkv'))


def test_a_play_list_opens_no_other_file(tmp_path) -> None:
    other = write_video(tmp_path / 'other.ts')
    path = tmp_path / 'a.mp4'
    path.write_text(f'#EXTM3U\n#EXT-X-TARGETDURATION:5\n#EXTINF:5,\n{other}\n#EXT-X-ENDLIST\n')
    with pytest.raises(RecordingError, match='cannot be read'):
        VideoReader(path)


def test_a_file_that_is_not_a_video_is_refused(tmp_path) -> None:
    (tmp_path / 'a.mp4').write_bytes(b'not a video')
    for name in ('a.mp4', 'missing.mp4'):
        with pytest.raises(RecordingError):
            VideoReader(tmp_path / name)


def test_what_was_written_can_be_read(tmp_path) -> None:
    with VideoWriter(tmp_path / 'a.mp4', 5.0) as video:
        for number in range(12):
            video.write(picture(number))
    assert times_s(tmp_path / 'a.mp4') == [round(0.2 * k, 3) for k in range(12)]


def test_no_video_is_left_after_an_error(tmp_path) -> None:
    def fail() -> None:
        with VideoWriter(tmp_path / 'a.mp4', 5.0) as video:
            video.write(np.zeros((64, 64, 3), np.uint8))
            raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        fail()
    assert list(tmp_path.iterdir()) == []


def test_frames_of_another_size_are_refused(tmp_path) -> None:
    with VideoWriter(tmp_path / 'a.mp4', 5.0) as video:
        video.write(np.zeros((64, 64, 3), np.uint8))
        with pytest.raises(RecordingError, match='after ones'):
            video.write(np.zeros((32, 64, 3), np.uint8))


@pytest.mark.parametrize('text', ['', 'high', '100:low', '0:20', '100:-3', 'nan:20', '1e9:20'])
def test_altitudes_that_make_no_sense_are_refused(text) -> None:
    with pytest.raises(RecordingError, match='START:END'):
        AltitudeProfile.parse(text)


def test_an_assumed_altitude_is_linear_in_time() -> None:
    poses = AltitudeProfile.parse('100:20').poses(1_000_000_000, 5_000_000_000)
    assert len(poses) == 41
    assert [poses[k].altitude_agl_m for k in (0, 10, 40)] == pytest.approx([100.0, 80.0, 20.0])
    assert poses[-1].stamp_ns == 5_000_000_000


def test_one_altitude_holds_for_the_whole_video() -> None:
    assert AltitudeProfile.parse('60') == AltitudeProfile(60.0, 60.0)


def test_a_video_for_which_the_disk_has_no_room_leaves_the_old_one(tmp_path) -> None:
    path = tmp_path / 'a.mp4'
    path.write_bytes(b'old')
    noise = np.random.default_rng(1).integers(0, 256, (40, 120, 160, 3), np.uint8)
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)

    def write() -> None:
        with VideoWriter(path, 5.0) as video:
            for image in noise:
                video.write(image)

    resource.setrlimit(resource.RLIMIT_FSIZE, (100_000, hard))
    try:
        with pytest.raises(RecordingError, match='of 40 frames are in the file'):
            write()
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    assert [each.name for each in tmp_path.iterdir()] == ['a.mp4']
    assert path.read_bytes() == b'old'
    write()
    assert path.stat().st_size > 100_000
