# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Logs of a flight that lie beside a video or a bag: poses and modes of the vehicle.

MAVLink telemetry (``.tlog``) and ArduPilot DataFlash (``.bin``) are read with pymavlink, PX4 ULog
(``.ulg``) with pyulog, which comes with the extra ``logs``, DJI subtitles (``.srt``) here.
"""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Iterator
from contextlib import contextmanager, redirect_stdout
from dataclasses import dataclass, field
from enum import Enum
from io import BufferedReader, FileIO, StringIO
from itertools import groupby
from math import cos, isfinite, radians
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from peace_ros.core.domain import Pose, RecordingError
from peace_ros.core.domain.geometry import quaternion_from_euler

_EARTH_RADIUS_M = 6_378_137.0
_ATTITUDE_APART_S = 0.5
"""A position without an attitude this near in time is left out."""
_UNIX_S = 1e9
"""Stamps from here on are Unix time, earlier ones count from the boot of the autopilot."""
_HIGHEST_M = 20_000.0
_LARGEST_BYTES = 4 << 30
_DATAFLASH_PADDING_BYTES = 528
"""Logs that were written in blocks may end with this much of an older log."""
_INVALID_AUTOPILOT = 8  # MAV_AUTOPILOT_INVALID: ground stations, cameras, gimbals


class LogClock(Enum):
    """From where the stamps of a log count."""

    VIDEO = 'the first frame of its video'
    UNIX = 'Unix time'
    BOOT = 'the boot of the autopilot'


@dataclass(frozen=True)
class FlightLog:
    """Where the vehicle was, as it recorded it itself."""

    poses: list[Pose]
    """In the order of their stamps; NED from the first position, altitude above home."""
    modes: list[tuple[int, str]]
    """(Stamp in ns, mode) of each change."""
    clock: LogClock
    remarks: list[str]
    """What was left out or assumed."""


@dataclass
class _Track:
    """Positions and attitudes as they stand in a log, each with its own times in seconds."""

    positions: list[tuple[float, float, float, float]] = field(default_factory=list)
    """(time, north or latitude, east or longitude, altitude above home)"""
    attitudes: list[tuple[float, float, float, float, float]] = field(default_factory=list)
    """(time, quaternion NED/FRD)"""
    modes: list[tuple[float, str]] = field(default_factory=list)
    in_degrees: bool = True
    """Positions are latitude and longitude, otherwise metres."""
    remarks: list[str] = field(default_factory=list)

    def add_angles(self, at_s: float, roll: float, pitch: float, yaw: float) -> None:
        """Add an attitude in radians."""
        self.attitudes.append((at_s, *quaternion_from_euler(roll, pitch, yaw)))


def read_flight_log(path: Path) -> FlightLog:
    """Read a log by its suffix.

    Raises:
        RecordingError: it is not a log, is damaged, or holds no pose.
    """
    reader = _READERS.get(path.suffix.lower())
    if reader is None or not path.is_file():
        raise RecordingError(f'{path} is not a flight log: give a file of {", ".join(_READERS)}')
    if path.stat().st_size > _LARGEST_BYTES:
        raise RecordingError(f'{path} is larger than {_LARGEST_BYTES >> 30} GiB: give a part of it')
    try:
        with _quiet():
            track = reader(path)
    except (ModuleNotFoundError, RecordingError):
        raise
    except Exception as error:  # pymavlink raises what it likes on damaged files, Exception too
        raise RecordingError(
            f'{path} cannot be read as a {path.suffix} log ({type(error).__name__}: {error}): give '
            'an intact one'
        ) from error
    return _flight_log(track, path)


@contextmanager
def _quiet() -> Iterator[None]:
    """Keep the readers, which are compiled in part, from writing to the terminal."""
    kept, null = os.dup(2), os.open(os.devnull, os.O_WRONLY)
    try:
        os.dup2(null, 2)
        with redirect_stdout(StringIO()):
            yield
    finally:
        os.dup2(kept, 2)
        os.close(kept)
        os.close(null)


def subtitles_of(video: Path) -> Path | None:
    """Return the DJI telemetry that lies beside a video, None where there is none."""
    for suffix in ('.SRT', '.srt'):
        if (beside := video.with_suffix(suffix)).is_file() and _CUE.search(_text_of(beside)):
            return beside
    return None


def _flight_log(track: _Track, path: Path) -> FlightLog:
    positions = np.array([each for each in track.positions if all(map(isfinite, each))])
    attitudes = np.array([each for each in track.attitudes if all(map(isfinite, each))])
    remarks = list(track.remarks)
    if not len(positions) or not len(attitudes):
        raise RecordingError(
            f'{path} holds {len(positions)} positions with a height above home and '
            f'{len(attitudes)} attitudes: give a log of a flight that has both'
        )
    positions, attitudes = _ordered(positions), _ordered(attitudes)
    if track.in_degrees:
        positions = positions[_known_places(positions[:, 1:3])]
        positions[:, 1:3] = _metres(positions[:, 1:3])
    plausible = np.abs(positions[:, 3]) < _HIGHEST_M
    turns = _turns_at(positions[:, 0], attitudes)
    usable = plausible & np.isfinite(turns[:, 0])
    poses = [
        Pose(round(at_s * 1e9), north, east, -height, tuple(turn), height)
        for (at_s, north, east, height), turn in zip(
            positions[usable].tolist(), turns[usable].tolist(), strict=True
        )
    ]
    if not poses:
        raise RecordingError(f'{path}: no position has an attitude within {_ATTITUDE_APART_S} s')
    if left_out := len(track.positions) - len(poses):
        remarks.append(
            f'{left_out} positions of {path.name} left out: repeated, damaged or without'
        )
        remarks[-1] += f' an attitude within {_ATTITUDE_APART_S} s'
    modes = [next(group) for _, group in groupby(track.modes, key=lambda each: each[1])]
    if path.suffix.lower() == '.srt':
        clock = LogClock.VIDEO
    else:
        clock = LogClock.UNIX if positions[0, 0] > _UNIX_S else LogClock.BOOT
    return FlightLog(poses, [(round(at * 1e9), mode) for at, mode in modes], clock, remarks)


def _ordered(rows: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return rows in the order of their times, each time once."""
    _, first = np.unique(rows[:, 0], return_index=True)
    return rows[first]


def _known_places(degrees: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Return where a place is given; 0, 0 is that of no GNSS, unless there is no other."""
    possible = np.all(np.abs(degrees) <= (90.0, 180.0), axis=1)
    given = possible & degrees.any(axis=1)
    return np.asarray(given if given.any() else possible)


def _metres(degrees: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return north and east of the first place, on a plane that touches the sphere there."""
    origin = degrees[0]
    scale = radians(1.0) * _EARTH_RADIUS_M * np.array([1.0, cos(radians(float(origin[0])))])
    return np.asarray((degrees - origin) * scale)


def _turns_at(times: NDArray[np.float64], attitudes: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the attitude at each time between its neighbours, NaN where none is near."""
    known, turns = attitudes[:, 0], attitudes[:, 1:].copy()
    # q and -q are one attitude: take the sign that is nearer to the one before.
    flips = np.sign(np.sum(turns[1:] * turns[:-1], axis=1))
    turns[1:] *= np.cumprod(np.where(flips < 0.0, -1.0, 1.0))[:, None]
    found = np.stack([np.interp(times, known, turns[:, axis]) for axis in range(4)], axis=1)
    found /= np.maximum(1e-9, np.linalg.norm(found, axis=1, keepdims=True))
    after = np.clip(np.searchsorted(known, times), 0, len(known) - 1)
    before = np.maximum(after - 1, 0)
    apart = np.minimum(np.abs(known[after] - times), np.abs(known[before] - times))
    found[apart > _ATTITUDE_APART_S] = np.nan
    return found


def _read_tlog(path: Path) -> _Track:
    """Read the messages of one autopilot; their times are those of receipt on the ground."""
    from pymavlink.mavutil import mode_string_v10  # noqa: PLC0415 -- slow to import

    from peace_ros.recording.telemetry_log import TelemetryLog  # noqa: PLC0415 -- as above

    heartbeat, attitude, position = 0, 30, 33  # MAVLink numbers; the last is GLOBAL_POSITION_INT
    log = TelemetryLog(path, (heartbeat, attitude, position))
    track, autopilot = _Track(), None
    for at_s, message in log.messages():
        kind = message.get_msgId()
        is_flying = kind == heartbeat and message.autopilot != _INVALID_AUTOPILOT
        if autopilot is None and is_flying:
            autopilot = message.get_srcSystem()
        if message.get_srcSystem() != autopilot:
            continue
        if is_flying:
            track.modes.append((at_s, str(mode_string_v10(message))))
        elif kind == attitude:
            track.add_angles(at_s, message.roll, message.pitch, message.yaw)
        elif kind == position:
            place = message.lat * 1e-7, message.lon * 1e-7, message.relative_alt * 1e-3
            track.positions.append((at_s, *place))
    if log.remark:
        track.remarks.append(log.remark)
    return track


def _read_dataflash(path: Path) -> _Track:
    """Read POS, ATT and MODE of ArduPilot; Unix time where the log has GNSS."""
    from pymavlink.DFReader import DFReader_binary  # noqa: PLC0415 -- slow to import

    log, track = DFReader_binary(str(path)), _Track()
    try:
        known = sum(
            len(at) * log.formats[kind].len
            for kind, at in enumerate(log.offsets)
            if kind in log.formats
        )
        if (unknown := path.stat().st_size - known) >= _DATAFLASH_PADDING_BYTES:
            track.remarks.append(
                f'{unknown} of {path.stat().st_size} bytes of {path.name} are damaged, or come '
                'after damage that the reader cannot pass: left out'
            )
        while (message := log.recv_match(type=['POS', 'ATT', 'MODE'])) is not None:
            at_s, kind = float(message._timestamp), message.get_type()  # noqa: SLF001 (pymavlink)
            if kind == 'POS':
                place = float(message.Lat), float(message.Lng), float(message.RelHomeAlt)
                track.positions.append((at_s, *place))
            elif kind == 'ATT':
                angles = message.Roll, message.Pitch, message.Yaw
                track.add_angles(at_s, *(radians(float(each)) for each in angles))
            elif kind == 'MODE':
                track.modes.append((at_s, str(log.flightmode)))
    finally:
        log.close()
    return track


def _read_ulog(path: Path) -> _Track:
    """Read vehicle_local_position, vehicle_attitude and the mode of PX4."""
    from pyulog import ULog  # noqa: PLC0415 -- optional: the extra "logs"

    wanted = ['vehicle_local_position', 'vehicle_attitude', 'vehicle_status', 'home_position']
    gnss = ['vehicle_gps_position', 'sensor_gps']
    with _WatchedFile(FileIO(path)) as file:
        log = ULog(file, [*wanted, *gnss])
        missing = file.missing
    by_name = {each.name: each.data for each in reversed(log.data_list)}
    track = _Track(in_degrees=False)
    unix_s = next((_unix_offset_s(by_name[name]) for name in gnss if name in by_name), 0.0)
    place, turn = by_name['vehicle_local_position'], by_name['vehicle_attitude']
    home_down_m = 0.0
    if 'home_position' in by_name and len(by_name['home_position']['z']):
        home_down_m = float(by_name['home_position']['z'][-1])
    else:
        track.remarks.append('the log has no home: altitudes count from the place of arming')
    times = place['timestamp'] * 1e-6 + unix_s
    rows = zip(times, place['x'], place['y'], home_down_m - place['z'], strict=True)
    track.positions = [(float(t), float(n), float(e), float(h)) for t, n, e, h in rows]
    axes = (turn[f'q[{axis}]'] for axis in range(4))
    quaternions = np.stack([turn['timestamp'] * 1e-6 + unix_s, *axes], axis=1)
    track.attitudes = [tuple(each) for each in quaternions.tolist()]
    if 'vehicle_status' in by_name:
        status = by_name['vehicle_status']
        stamped = zip(status['timestamp'] * 1e-6 + unix_s, status['nav_state'], strict=True)
        track.modes = [(float(at), _NAV_STATES.get(int(s), f'nav_state {s}')) for at, s in stamped]
    if log.file_corruption:
        track.remarks.append(f'{path.name} is damaged in places: what is there is used')
    if missing:
        track.remarks.append(
            f'the last {missing} bytes of {path.name} are no whole message: it was cut short, or '
            'is damaged before them; they are left out'
        )
    return track


class _WatchedFile(BufferedReader):
    """A file that knows whether its end came too early.

    pyulog ends in silence where a message seems to be longer than the rest of the file.
    """

    missing = 0
    """Bytes of the last read when they were fewer than asked for."""

    def read(self, size: int | None = -1, /) -> bytes:
        """Read as any file does."""
        data = super().read(size)
        self.missing = len(data) if size is not None and len(data) < size else 0
        return data


def _unix_offset_s(gnss: dict[str, Any]) -> float:
    """Return the seconds from the boot of the autopilot to Unix time, 0 where not known."""
    utc = np.asarray(gnss.get('time_utc_usec', ()), np.float64)
    known = utc > _UNIX_S * 1e6
    if not known.any():
        return 0.0
    return float(np.median(utc[known] - np.asarray(gnss['timestamp'], np.float64)[known])) * 1e-6


_NAV_STATES = {
    0: 'MANUAL',
    1: 'ALTCTL',
    2: 'POSCTL',
    3: 'AUTO_MISSION',
    4: 'AUTO_LOITER',
    5: 'AUTO_RTL',
    10: 'ACRO',
    12: 'DESCEND',
    13: 'TERMINATION',
    14: 'OFFBOARD',
    15: 'STAB',
    17: 'AUTO_TAKEOFF',
    18: 'AUTO_LAND',
    19: 'AUTO_FOLLOW_TARGET',
    20: 'AUTO_PRECLAND',
    21: 'ORBIT',
}
"""VehicleStatus.nav_state of PX4."""

_CUE = re.compile(r'(\d+):(\d\d):(\d\d)[,.](\d{1,3})\s*-->[^\n]*\n(.*?)(?=\n\s*\n|\Z)', re.DOTALL)
_NUMBER = r'\s*:\s*(-?\d+(?:\.\d+)?)'
_LARGEST_SUBTITLES = 64 << 20


def _text_of(path: Path) -> str:
    with path.open('rb') as file:
        return file.read(_LARGEST_SUBTITLES).decode('utf-8-sig', 'replace').replace('\r\n', '\n')


def _read_subtitles(path: Path) -> _Track:
    """Read what DJI writes beside a video: relative altitude, position, attitude of the gimbal.

    The gimbal takes the place of the vehicle: a camera that looks straight down has pitch -90.
    """
    track, places = _Track(), 0
    has_heading = False
    for hours, minutes, seconds, part, text in _CUE.findall(_text_of(path)):
        at_s = int(hours) * 3600 + int(minutes) * 60 + int(seconds) + int(part.ljust(3, '0')) / 1e3
        value = {
            name: float(found[1])
            for name, pattern in _DJI_FIELDS.items()
            if (found := re.search(pattern + _NUMBER, text))
        }
        if 'height' not in value:
            continue
        place = value.get('latitude', 0.0), value.get('longitude', 0.0)
        has_heading |= 'yaw' in value
        places += place != (0.0, 0.0)
        # Without a heading the direction of the motion in the picture is not known.
        place = place if 'yaw' in value else (0.0, 0.0)
        track.positions.append((at_s, *place, value['height']))
        roll, pitch, yaw = (value.get(name, 0.0) for name in ('roll', 'pitch', 'yaw'))
        ahead = pitch + 90.0 if 'pitch' in value else 0.0
        track.add_angles(at_s, *map(radians, (roll, ahead, yaw)))
    if not has_heading:
        track.remarks.append(
            f'{path.name} has no heading: the camera is taken to stay above one place, up is north'
        )
    return track


_DJI_FIELDS = {
    'height': r'\brel_alt',
    'latitude': r'\blatitude',
    'longitude': r'\blongt?itude',
    'yaw': r'\bgb_yaw',
    'pitch': r'\bgb_pitch',
    'roll': r'\bgb_roll',
}
_READERS: dict[str, Callable[[Path], _Track]] = {
    '.tlog': _read_tlog,
    '.bin': _read_dataflash,
    '.ulg': _read_ulog,
    '.srt': _read_subtitles,
}
LOG_SUFFIXES = tuple(_READERS)
