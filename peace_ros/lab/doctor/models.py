# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Model bundles with their checksums, the execution provider, and the time of a frame."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from peace_ros.core.domain import Frame, PeaceError
from peace_ros.core.inference import Bundle
from peace_ros.core.inference.providers import CPU, TENSORRT, engine_folder
from peace_ros.core.inference.session import providers_of_role
from peace_ros.core.pipeline import Pipeline, create_generator, segmentation_of
from peace_ros.core.presets import Preset
from peace_ros.core.prompting import PromptingParameters
from peace_ros.core.segmentation import create_segmenter
from peace_ros.lab.benchmark.scene import draw_frames
from peace_ros.lab.doctor.finding import Finding, Findings, fine, mend, not_checked, of_error

FRAMES = 3
SLOWEST_S = 1.0
"""The segmentation node warns from here on."""
MOST_DIFFERENT = 0.1
"""Of safety between two providers in 99 of 100 pixels; bf16 and fp16 may cost some of it."""


class Models:
    """The networks of one configuration, loaded as the nodes load them."""

    def __init__(
        self, preset: Preset, providers: Sequence[str] = (), *, builds_engines: bool = False
    ) -> None:
        """Load nothing yet.

        Args:
            preset: Whose models are meant.
            providers: Execution providers in place of those of the preset; empty: the preset's.
            builds_engines: Whether TensorRT may build what it has not built yet, for minutes.

        Raises:
            ConfigurationError: A value of the preset cannot be used.
        """
        given = {'providers': tuple(providers)}
        self._preset = preset
        self._segmentation, self._own = segmentation_of(preset, **given)
        self._prompting = preset.fill('prompt_generator', PromptingParameters, **given)
        self._builds_engines = builds_engines
        self._notes = _Notes()
        self._pipeline: Pipeline | None = None

    def load(self) -> Findings:
        """Open the bundles, which compares every file with its checksum, and run them once."""
        yield fine(f'configuration {self._preset.name} ({self._preset.path.name})')
        segmenter: Any = None
        generator: Any = None
        try:
            yield from self._whole(self._segmentation.bundle)
            segmenter = self._unless_engines_are_missing(
                self._segmentation,
                lambda: create_segmenter(self._segmentation, self._own, log=self._notes),
            )
        except PeaceError as error:
            yield of_error(error)
        yield from self._notes.take()
        try:
            if not self._prompting.is_static:
                yield from self._whole(self._prompting.bundle)
            generator = self._unless_engines_are_missing(
                self._prompting, lambda: create_generator(self._prompting, self._notes)
            )
        except PeaceError as error:
            yield of_error(error)
        yield from self._notes.take()
        if segmenter is not None and generator is not None:
            self._pipeline = Pipeline(segmenter, generator)

    def time_frame(self, width_px: int, height_px: int) -> Findings:
        """Yield how long a frame of the camera's size takes once the networks are warm.

        Args:
            width_px: Of the camera's frames.
            height_px: The same.
        """
        if self._pipeline is None:
            yield not_checked('time of a frame: the models are not loaded')
            return
        times_ms = []
        try:
            for frame in _frames(width_px, height_px):
                began_s = time.perf_counter()
                self._pipeline.look(frame)
                times_ms.append(1000.0 * (time.perf_counter() - began_s))
        except PeaceError as error:
            yield of_error(error)
            return
        taken_ms = float(np.median(times_ms[1:]))
        found = f'a warm frame of {width_px} x {height_px} px takes {taken_ms:.0f} ms'
        figures = {'frame_ms': round(taken_ms, 1), 'first_frame_ms': round(times_ms[0], 1)}
        if taken_ms <= 1000.0 * SLOWEST_S:
            yield fine(found, **figures)
            return
        remedy = (
            f'at most {SLOWEST_S:g} s are good: lower clipseg_max_looks or the resolution of the '
            'camera, choose a faster provider, or end other processes'
        )
        yield mend(found, remedy, **figures)

    def compare(self, width_px: int, height_px: int) -> Findings:
        """Yield whether the providers give the heatmaps of ONNX Runtime's CPU provider.

        An engine may read an operator in another way, and runs on without an error: see
        docs/models.md. Takes a second load of the networks.

        Args:
            width_px: Of the camera's frames.
            height_px: The same.
        """
        chosen = self._segmentation.providers
        if self._pipeline is None or tuple(chosen) == (CPU,):
            return
        difference = 0.0
        try:
            common, own = segmentation_of(self._preset, providers=(CPU,))
            usual = create_segmenter(common, own, log=self._notes)
            [*self._notes.take()]
            for frame in _frames(width_px, height_px):
                look = self._pipeline.look(frame)
                safety = usual.segment(frame, look.prompt).safety
                apart = np.quantile(np.abs(safety - look.heatmap.safety), 0.99)
                difference = max(difference, float(apart))
        except PeaceError as error:
            yield of_error(error)
            return
        found = (
            f'{", ".join(chosen)}: safety differs from that of {CPU} by {difference:.3f} at most '
            'in 99 % of the pixels'
        )
        if difference <= MOST_DIFFERENT:
            yield fine(found, safety_difference=round(difference, 5))
            return
        remedy = (
            f'at most {MOST_DIFFERENT:g} is good: the engine reads the network in another way; '
            f'use {CPU}, or export the model again with a newer opset'
        )
        yield mend(found, remedy, safety_difference=round(difference, 5))

    def _whole(self, name: str) -> Findings:
        bundle = Bundle.load(name)
        manifest = bundle.manifest
        size_mb = sum(each.bytes for each in manifest.files.values()) / 1e6
        yield fine(
            f'bundle {manifest.name}: {len(manifest.files)} files, {size_mb:.1f} MB, each with the '
            'checksum of the manifest',
            bundle=manifest.name,
            sha256=bundle.checksum,
        )

    def _unless_engines_are_missing(self, parameters: Any, create: Callable[[], Any]) -> Any:
        """Load, but do not let TensorRT build engines here, which takes minutes."""
        if TENSORRT in parameters.providers and not self._builds_engines:
            manifest = Bundle.load(parameters.bundle).manifest
            for role, name in manifest.roles.items():
                chosen = providers_of_role(manifest.family, role, parameters.providers)
                if TENSORRT not in chosen or not name.endswith('.onnx'):
                    continue
                if not any(engine_folder(manifest.files[name].sha256).glob('*.engine')):
                    self._notes.missing_engine(manifest.name, name, self._preset.name)
                    return None
        return create()


class _Notes:
    """Takes what loading logs, as findings."""

    def __init__(self) -> None:
        self._findings: list[Finding] = []

    def info(self, message: str, /) -> None:
        self._findings.append(fine(message))

    def warning(self, message: str, /) -> None:
        self._findings.append(
            mend(message, 'choose another word in the file of the terms, or another bundle')
        )

    def missing_engine(self, bundle: str, name: str, preset: str) -> None:
        self._findings.append(
            mend(
                f'bundle {bundle}: TensorRT has built no engine of {name} on this device',
                f'run peace models warm --config {preset}, which takes minutes, before a flight',
            )
        )

    def take(self) -> Findings:
        found, self._findings = self._findings, []
        yield from found


def _frames(width_px: int, height_px: int) -> list[Frame]:
    def resized(frame: Frame) -> NDArray[np.uint8]:
        image = cv2.resize(frame.image_rgb, (width_px, height_px), interpolation=cv2.INTER_AREA)
        return np.asarray(image, np.uint8)

    return [Frame(resized(each), each.stamp_ns) for each in draw_frames(1 + FRAMES)]
