# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The console scripts.

What they run takes seconds to import, and an interrupt in those seconds would end in a traceback
from inside somebody's library. So the import happens here, under a handler that ends quietly.
"""

from __future__ import annotations

import importlib
import os
import signal
import sys
from types import FrameType
from typing import Any

from peace_ros.cli.extras import how_to_install

EXIT_REFUSED, EXIT_INTERRUPTED = 2, 130


def _leave(_number: int, _frame: FrameType | None) -> None:
    # An exception could be swallowed or dressed up by whatever import it strikes.
    os._exit(EXIT_INTERRUPTED)


def start(module: str) -> Any:
    """Import a module and run its ``main``.

    An interrupt before that is exit status 130; a package that is missing is one sentence and 2.
    """
    previous = signal.signal(signal.SIGINT, _leave)
    try:
        main = importlib.import_module(module).main
    except ModuleNotFoundError as error:
        if (sentence := how_to_install(error)) is None:
            raise
        print(f'{module}: {sentence}', file=sys.stderr)
        sys.exit(EXIT_REFUSED)
    signal.signal(signal.SIGINT, previous)
    return main()


def peace() -> Any:
    """Run the command line."""
    return start('peace_ros.cli.main')


def prompt_generator() -> Any:
    """Run the node of this name, as all below."""
    return start('peace_ros.nodes.prompt_generator')


def segmentation() -> Any:
    """Run the node."""
    return start('peace_ros.nodes.segmentation')


def perception() -> Any:
    """Run prompt generator and segmentation in one process."""
    return start('peace_ros.nodes.perception')


def landing() -> Any:
    """Run the node."""
    return start('peace_ros.nodes.landing')


def recorder() -> Any:
    """Run the node beside those that fly."""
    return start('peace_ros.recorder.recorder')


def satellite_view() -> Any:
    """Run the node."""
    return start('peace_ros.simulation.nodes.satellite_view')


def autopilot_sim() -> Any:
    """Run the node."""
    return start('peace_ros.simulation.nodes.autopilot_sim')


def watch() -> Any:
    """Run the node."""
    return start('peace_ros.watch.watch')
