# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""``peace watch``: the watch node with options for people."""

from __future__ import annotations

from typing import Annotated

import typer
from typer import Option

from peace_ros.cli.extras import require
from peace_ros.watch.options import WatchOptions


def watch(
    *,
    namespace: Annotated[
        str, Option(metavar='NAME', help='Namespace of the vehicle, such as drone_1.')
    ] = '',
    port: Annotated[
        int, Option(metavar='N', min=0, max=65535, help='Port on 127.0.0.1; 0 takes a free one.')
    ] = WatchOptions().port,
    viewers: Annotated[
        int, Option(metavar='N', min=1, max=16, help='Pages that may be open at the same time.')
    ] = WatchOptions().viewers,
) -> None:
    """Show a landing on a local web page until Ctrl-C: camera, map, reasons, health, commands.

    Prints the address of the page; its token allows to engage and disengage.
    """
    require('starlette', 'uvicorn', 'websockets', 'rclpy')
    from peace_ros.watch.watch import main

    given = ['--ros-args', '-p', f'port:={port}', '-p', f'viewers:={viewers}']
    if namespace:
        given += ['-r', f'__ns:=/{namespace.strip("/")}']
    raise typer.Exit(main(given))
