# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The cores of one configuration, put together in one way for flight, replay, evaluation and you.

pipeline = Pipeline.from_preset('peace_cs')
heatmap = pipeline.segment(read_image('photo.jpg'))
"""

from __future__ import annotations

import logging
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from peace_ros.core.domain import NADIR, Camera, ConfigurationError, Frame, Heatmap, Mount, Prompt
from peace_ros.core.inference import Bundle, ClipEncoder
from peace_ros.core.landing import LandingCore, LandingParameters
from peace_ros.core.mapping import MapParameters
from peace_ros.core.presets import DEFAULT_PRESET, Preset, load_preset
from peace_ros.core.prompting import (
    Encoder,
    PromptGenerator,
    PromptingParameters,
    load_vocabularies,
)
from peace_ros.core.segmentation import (
    CameraWatch,
    Log,
    SegmentationParameters,
    Segmenter,
    create_segmenter,
    family_of,
)

_LOG = logging.getLogger(__name__)


@dataclass(frozen=True)
class SegmentedFrame:
    """A frame and what the networks make of it."""

    frame: Frame
    prompt: Prompt
    heatmap: Heatmap


class Pipeline:
    """Prompt generator, camera watch and segmenter: Frame -> Prompt -> Heatmap."""

    def __init__(self, segmenter: Segmenter, generator: PromptGenerator | None = None) -> None:
        """Put cores together.

        Args:
            segmenter: of any family.
            generator: None where prompts come from elsewhere.
        """
        self.segmenter = segmenter
        self.generator = generator
        self._camera = CameraWatch()

    @classmethod
    def from_preset(
        cls, preset: Preset | Path | str = DEFAULT_PRESET, *, threads: int = 0, log: Log = _LOG
    ) -> Pipeline:
        """Load the models of a configuration.

        Args:
            preset: the name of a shipped one (``peace_cs``), or a ROS parameter file.
            threads: CPU threads of the networks; 0 takes what the preset says.
            log: gets a line about each model and a warning for each term that it cannot see.

        Raises:
            PeaceError: the preset, its terms, vocabularies or bundles cannot be used.
        """
        loaded = preset if isinstance(preset, Preset) else load_preset(preset)
        segmentation, own = segmentation_of(loaded, threads=threads)
        prompting = loaded.fill('prompt_generator', PromptingParameters, threads=threads)
        segmenter = create_segmenter(segmentation, own, log=log)
        return cls(segmenter, create_generator(prompting, log))

    def segment(self, image_rgb: NDArray[np.uint8]) -> Heatmap:
        """Return the heatmap of one picture on its own; a new sequence of frames begins after it.

        Args:
            image_rgb: height x width x 3.

        Raises:
            ImageError: it cannot be used; see :meth:`heatmap`.
        """
        self.reset()
        try:
            return self.look(Frame(image_rgb, 0)).heatmap
        finally:
            self.reset()

    def look(self, frame: Frame) -> SegmentedFrame:
        """Return the prompt and heatmap of the next frame of a sequence, as in flight.

        Raises:
            ImageError: see :meth:`heatmap`.
            BundleError: an answer of the networks cannot be used.
        """
        prompt = self.prompt(frame)
        return SegmentedFrame(frame, prompt, self.heatmap(frame, prompt))

    def prompt(self, frame: Frame) -> Prompt:
        """Return the prompt for the next frame of a sequence."""
        if self.generator is None:
            raise ConfigurationError('pipeline without a prompt generator: give it one')
        return self.generator.generate(frame)

    def heatmap(self, frame: Frame, prompt: Prompt) -> Heatmap:
        """Return the heatmap of a frame that a working camera may have taken.

        Raises:
            ImageError: it shows nothing, has another shape than the frames before, or cannot be
                used by the networks.
            BundleError: an answer of the networks cannot be used.
        """
        self._camera.check(frame)
        heatmap = self.segmenter.segment(frame, prompt)
        return replace(heatmap, frame_size_px=frame.size_px, camera=frame.camera)

    def reset(self) -> None:
        """Forget the frames so far: the next one begins another sequence."""
        self._camera = CameraWatch()
        if self.generator is not None:
            self.generator.reset()


def segmentation_of(preset: Preset, **given: Any) -> tuple[SegmentationParameters, Any]:
    """Return the parameters of a preset's segmentation, and those of its family.

    Args:
        preset: of the nodes.
        given: values that go before those of the preset; see :meth:`Preset.fill`.

    Raises:
        ConfigurationError: the family is unknown or a value cannot be used.
    """
    common = preset.fill('segmentation', SegmentationParameters, **given)
    return common, preset.fill('segmentation', family_of(common).parameters, **given)


def create_generator(
    parameters: PromptingParameters, log: Log = _LOG, encoder: Encoder | None = None
) -> PromptGenerator:
    """Make the prompt generator; a static template needs neither a model nor vocabularies.

    Args:
        parameters: of the prompts.
        log: gets a line about the model.
        encoder: in place of loading the bundle.

    Raises:
        PeaceError: vocabularies or bundle cannot be used.
    """
    if parameters.is_static:
        return PromptGenerator(None, None, parameters)
    vocabularies = load_vocabularies(parameters.vocabularies)
    if encoder is not None:
        return PromptGenerator(encoder, vocabularies, parameters)
    encoder = ClipEncoder(
        Bundle.load(parameters.bundle),
        threads=parameters.threads,
        providers=parameters.providers,
        cache_dir=Path(parameters.cache_dir).expanduser() if parameters.cache_dir else None,
    )
    log.info(f'model: {encoder.footprint}')
    return PromptGenerator(encoder, vocabularies, parameters)


def create_landing(preset: Preset, camera: Camera, mount: Mount = NADIR) -> LandingCore:
    """Make the landing core of a preset for the frames of a camera.

    Raises:
        ConfigurationError: a value of the preset cannot be used.
    """
    return LandingCore(
        preset.fill('landing', LandingParameters),
        camera,
        preset.fill('landing', MapParameters),
        mount,
    )
