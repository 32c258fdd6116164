# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What a replay gave, frame by frame and decision by decision: kept in one file, compared later."""

from __future__ import annotations

import io
import json
import platform
import zipfile
import zlib
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from peace_ros import __version__
from peace_ros.core.domain import RecordingError
from peace_ros.core.inference import Bundle
from peace_ros.core.pipeline import SegmentedFrame, segmentation_of
from peace_ros.core.presets import Preset
from peace_ros.core.prompting import PromptingParameters
from peace_ros.lab.replay.line import Step
from peace_ros.lab.replay.report import SAFE_FROM, ReplayReport
from peace_ros.recording.run_folder import write_whole

_FORMAT = 1
_DAMAGE = (OSError, ValueError, KeyError, TypeError, EOFError, zipfile.BadZipFile, zlib.error)
_NOWHERE = (np.nan, np.nan)


@dataclass(frozen=True)
class Trace:
    """The answers of a replay: F frames with a heatmap, D decisions."""

    made_with: Mapping[str, str]
    """Version, preset, machine and checksums of the models."""
    frame_stamps_ns: NDArray[np.int64]
    """(F,), increasing."""
    prompts: tuple[str, ...]
    """Template of each frame."""
    mask_shape: tuple[int, int]
    """Height and width of the heatmaps."""
    masks: tuple[bytes, ...]
    """Of each frame, which pixels are safe; see :meth:`safe`."""
    step_stamps_ns: NDArray[np.int64]
    """(D,), increasing."""
    states: tuple[str, ...]
    """Of each decision."""
    sites_m: NDArray[np.float64]
    """(D, 2): north and east of the site; NaN where there is none."""
    setpoints_m_s: NDArray[np.float64]
    """(D, 3): velocity north, east, down."""
    used: int
    """Heatmaps that reached the map of the landing core."""
    was_engaged: bool

    def safe(self, index: int) -> NDArray[np.bool_]:
        """Return which pixels of a frame are safe, as bool of :attr:`mask_shape`."""
        bits = np.frombuffer(zlib.decompress(self.masks[index]), np.uint8)
        height, width = self.mask_shape
        return np.unpackbits(bits, count=height * width).reshape(height, width).astype(bool)

    @cached_property
    def distinct_states(self) -> tuple[str, ...]:
        """The states in the order in which they were entered."""
        return tuple(
            name for k, name in enumerate(self.states) if k == 0 or name != self.states[k - 1]
        )

    def write(self, path: Path) -> None:
        """Write one file, whole or not at all.

        Raises:
            RecordingError: the place cannot be written to.
        """
        about = {
            'format': _FORMAT,
            'made_with': dict(self.made_with),
            'used': self.used,
            'was_engaged': self.was_engaged,
        }
        buffer = io.BytesIO()
        np.savez_compressed(
            buffer,
            about=np.array(json.dumps(about)),
            frame_stamps_ns=self.frame_stamps_ns,
            prompts=np.array(self.prompts, dtype=np.str_),
            mask_shape=np.array(self.mask_shape),
            mask_sizes=np.array([len(each) for each in self.masks], np.int64),
            masks=np.frombuffer(b''.join(self.masks), np.uint8),
            step_stamps_ns=self.step_stamps_ns,
            states=np.array(self.states, dtype=np.str_),
            sites_m=self.sites_m,
            setpoints_m_s=self.setpoints_m_s,
        )
        write_whole(path, buffer.getvalue(), 'golden file')

    @classmethod
    def read(cls, path: Path) -> Trace:
        """Read what :meth:`write` wrote.

        Raises:
            RecordingError: it cannot be read, or is no such file.
        """
        try:
            with np.load(path, allow_pickle=False) as arrays:
                about = json.loads(str(arrays['about']))
                if about['format'] != _FORMAT:
                    raise ValueError(f'format {about["format"]} in place of {_FORMAT}')
                ends = np.cumsum(arrays['mask_sizes'])
                height, width = map(int, arrays['mask_shape'])
                packed = arrays['masks'].tobytes()
                return cls(
                    made_with=about['made_with'],
                    frame_stamps_ns=arrays['frame_stamps_ns'],
                    prompts=tuple(map(str, arrays['prompts'])),
                    mask_shape=(height, width),
                    masks=tuple(
                        packed[end - size : end]
                        for end, size in zip(ends, arrays['mask_sizes'], strict=True)
                    ),
                    step_stamps_ns=arrays['step_stamps_ns'],
                    states=tuple(map(str, arrays['states'])),
                    sites_m=arrays['sites_m'],
                    setpoints_m_s=arrays['setpoints_m_s'],
                    used=int(about['used']),
                    was_engaged=bool(about['was_engaged']),
                )
        except _DAMAGE as error:
            raise RecordingError(
                f'golden file {path} cannot be read ({type(error).__name__}: {error}): make it '
                'again with --remake-golden'
            ) from error


@dataclass
class TraceBuilder:
    """Follows a replay; about 2 kB for each frame stay in memory."""

    _frame_stamps_ns: list[int] = field(default_factory=list)
    _prompts: list[str] = field(default_factory=list)
    _mask_shape: tuple[int, int] = (0, 0)
    _masks: list[bytes] = field(default_factory=list)
    _steps: list[tuple[int, str, tuple[float, float], tuple[float, float, float]]] = field(
        default_factory=list
    )

    def add_look(self, look: SegmentedFrame) -> None:
        """Keep prompt and heatmap of a frame."""
        safe = look.heatmap.safety >= SAFE_FROM
        self._mask_shape = (safe.shape[0], safe.shape[1])
        self._frame_stamps_ns.append(look.frame.stamp_ns)
        self._prompts.append(look.prompt.template)
        self._masks.append(zlib.compress(np.packbits(safe).tobytes()))

    def add_step(self, step: Step) -> None:
        """Keep state, site and set-point of a decision."""
        decision, site = step.decision, step.decision.site
        told = decision.setpoint
        self._steps.append(
            (
                step.stamp_ns,
                decision.state.value,
                _NOWHERE if site is None else (site.north_m, site.east_m),
                (told.v_north_m_s, told.v_east_m_s, told.v_down_m_s),
            )
        )

    def trace(self, preset: Preset, report: ReplayReport) -> Trace:
        """Return what was kept of a replay with a preset, of which there is a report."""
        stamps, states, sites, setpoints = zip(*self._steps, strict=True)
        return Trace(
            made_with(preset),
            np.array(self._frame_stamps_ns, np.int64),
            tuple(self._prompts),
            self._mask_shape,
            tuple(self._masks),
            np.array(stamps, np.int64),
            states,
            np.array(sites, np.float64),
            np.array(setpoints, np.float64),
            report.heatmaps.get('used', 0),
            report.was_engaged,
        )


def made_with(preset: Preset) -> dict[str, str]:
    """Return what decides over the answers of a replay, beside the recording."""
    prompting = preset.fill('prompt_generator', PromptingParameters)
    segmentation, _ = segmentation_of(preset)
    bundles = [segmentation.bundle, *([] if prompting.is_static else [prompting.bundle])]
    return {
        'peace_ros': __version__,
        'preset': preset.name,
        'machine': f'{platform.machine()}, {_processor()}',
        **{f'model {each}': Bundle.load(each).checksum for each in bundles},
    }


def _processor() -> str:
    """Return the name of the processor, as far as the system says one."""
    try:
        lines = Path('/proc/cpuinfo').read_text(encoding='utf-8', errors='replace').splitlines()
    except OSError:
        lines = []
    names = [line.partition(':')[2].strip() for line in lines if line.startswith('model name')]
    return names[0] if names else platform.processor() or 'unknown'


def described(made: Mapping[str, str]) -> str:
    """Return what a replay was made with, in one line."""
    return ', '.join(
        f'{name} {value[:12]}' if name.startswith('model ') else f'{name} {value}'
        for name, value in made.items()
    )
