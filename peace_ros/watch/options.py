# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What the watch node can be told."""

from __future__ import annotations

from dataclasses import dataclass

from peace_ros.core.domain.parameters import ParameterSet, parameter
from peace_ros.core.node_parameters import Group


@dataclass(frozen=True)
class WatchOptions(ParameterSet):
    """Options of the watch node."""

    port: int = parameter(
        8765, 'TCP port of the page on 127.0.0.1; 0 takes a free one', low=0, high=65535
    )
    viewers: int = parameter(4, 'Pages that may be open at the same time', low=1, high=16)
    url_file: str = parameter(
        '',
        'File that gets the address of the page with its token; only its owner may read it',
    )


WATCH: tuple[Group, ...] = (('', WatchOptions),)
