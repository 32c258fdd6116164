# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What the recorded landing flies with: parameters of the nodes, and the models that they name."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from typing import Any, final

import yaml
from rcl_interfaces.srv import GetParameters, ListParameters
from rclpy.node import Node
from rclpy.parameter import parameter_value_to_python
from rclpy.task import Future

from peace_ros.core.domain import PeaceError
from peace_ros.core.inference import Bundle
from peace_ros.core.node_parameters import FLYING_NODES

_PERIOD_S = 1.0

Told = Callable[[str, Mapping[str, str]], None]


@final
class LandingSetting:
    """Asks each node that flies for its parameters once, whenever it comes.

    Args:
        node: asks, without waiting.
        told: gets ``parameters/<node>`` with a ROS parameter file as ``yaml``, and ``model/<name>``
            with the checksum of its manifest.
    """

    def __init__(self, node: Node, told: Told) -> None:
        self._node, self._told = node, told
        self._clients = {
            name: (
                node.create_client(ListParameters, f'{name}/list_parameters'),
                node.create_client(GetParameters, f'{name}/get_parameters'),
            )
            for name in FLYING_NODES
        }
        self._asked: set[str] = set()
        node.create_timer(_PERIOD_S, self._ask)

    def _ask(self) -> None:
        for name, clients in self._clients.items():
            if name not in self._asked and all(each.service_is_ready() for each in clients):
                self._asked.add(name)
                names = clients[0].call_async(ListParameters.Request())
                names.add_done_callback(partial(self._on_names, name))

    def _on_names(self, node: str, done: Future) -> None:
        names = list(done.result().result.names)
        values = self._clients[node][1].call_async(GetParameters.Request(names=names))
        values.add_done_callback(partial(self._on_answer, node, names))

    def _on_answer(self, node: str, names: list[str], done: Future) -> None:
        self._on_values(node, dict(zip(names, done.result().values, strict=True)))
        # Each client costs time whenever the node waits for messages.
        for client in self._clients.pop(node):
            self._node.destroy_client(client)

    def _on_values(self, node: str, got: Mapping[str, Any]) -> None:
        values = {name: _plain(parameter_value_to_python(each)) for name, each in got.items()}
        file = {f'/**/{node}': {'ros__parameters': values}}
        self._told(f'parameters/{node}', {'yaml': yaml.safe_dump(file, sort_keys=True)})
        bundle = values.get('bundle')
        if isinstance(bundle, str) and bundle:
            self._told(f'model/{bundle}', {'sha256 of its manifest': _checksum(bundle)})


def _plain(value: Any) -> Any:
    return value if isinstance(value, bool | int | float | str) else list(value or ())


def _checksum(bundle: str) -> str:
    """Return the checksum of a bundle, or why there is none: the recording goes on."""
    try:
        return Bundle.load(bundle).checksum
    except PeaceError as error:
        return f'unknown: {error}'
