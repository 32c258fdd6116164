# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Measures the gaps between set-points as an autopilot sees them, while Python is busy.

    python -m peace_ros.lab.evaluation.setpoint_gaps --seconds 60 --workers 2

A process of its own plays the autopilot and takes the time of each set-point. Beside the sender run
a thread that never rests (it competes for the interpreter, as numpy code between two calls does)
and ``--workers`` processes that never rest (they compete for the cores, as inference does). At the
end the decisions stop, and the time until the first zero is the dead-man.
"""

from __future__ import annotations

import json
import multiprocessing
import socket
import threading
import time
from dataclasses import asdict, dataclass
from multiprocessing.connection import Connection
from typing import Annotated

import numpy as np
import typer
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from peace_ros.core.domain.motion import Setpoint
from peace_ros.core.vehicle.link import open_vehicle
from peace_ros.core.vehicle.parameters import SenderParameters
from peace_ros.core.vehicle.sender import SetpointSender

DECISION_S = 0.04
WARM_UP_S = 1.0
GUIDED = 4
SETPOINT = 'SET_POSITION_TARGET_LOCAL_NED'
P99_MS = 150.0
DEAD_MAN_MS = 500.0
"""Age of a decision by which zero has taken its place."""
Seen = tuple[float, float]
"""Steady clock, and the velocity north of a set-point."""


@dataclass(frozen=True)
class Gaps:
    """What was measured; milliseconds."""

    setpoints: int
    median_ms: float
    p99_ms: float
    longest_ms: float
    dead_man_ms: float
    """From the last decision to the first zero."""


def measure(seconds: float, rate_hz: float, workers: int) -> Gaps:
    """Run the sender under load and return what the autopilot saw of it."""
    context = multiprocessing.get_context('spawn')
    ours, theirs = context.Pipe()
    ended = context.Event()
    helpers = [context.Process(target=_play_autopilot, args=(theirs, ended), daemon=True)]
    helpers += [context.Process(target=_burn, args=(ended,), daemon=True) for _ in range(workers)]
    for helper in helpers:
        helper.start()
    try:
        port = ours.recv()
        last_s = _command(port, seconds, rate_hz)
    finally:
        ended.set()
    seen: list[Seen] = ours.recv()
    for helper in helpers:
        helper.join(timeout=5.0)
    return _evaluate(seen, last_s)


def _command(port: int, seconds: float, rate_hz: float) -> float:
    """Fly for a while; return the steady clock of the last decision."""
    link = open_vehicle(f'udpout:127.0.0.1:{port}', timeout_s=30.0)
    rest = threading.Event()
    threading.Thread(target=_burn, args=(rest,), daemon=True).start()
    sender = SetpointSender(link, parameters=SenderParameters(rate_hz=rate_hz))
    sender.start()
    until = time.monotonic() + seconds + WARM_UP_S
    last_s = time.monotonic()
    while last_s < until:
        sender.submit(Setpoint(0, v_north_m_s=1.0))
        last_s = time.monotonic()
        time.sleep(DECISION_S)
    time.sleep(1.0)
    rest.set()
    sender.stop()
    link.close()
    return last_s


def _evaluate(seen: list[Seen], last_s: float) -> Gaps:
    begin_s = seen[0][0] + WARM_UP_S if seen else 0.0
    moving = [at_s for at_s, north in seen if north != 0.0 and at_s >= begin_s]
    zeros = [at_s for at_s, north in seen if north == 0.0 and at_s > last_s]
    if len(moving) < 2 or not zeros:
        return Gaps(len(moving), *(4 * (float('inf'),)))
    median, p99, longest = np.percentile(1e3 * np.diff(moving), [50, 99, 100], method='higher')
    dead_man_ms = 1e3 * (zeros[0] - last_s)
    return Gaps(len(moving), float(median), float(p99), float(longest), dead_man_ms)


def _play_autopilot(report: Connection, ended: threading.Event) -> None:
    """Say GUIDED each half second, and keep the time of each set-point."""
    line = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    line.bind(('127.0.0.1', 0))
    line.settimeout(0.05)
    report.send(line.getsockname()[1])
    codec = mavlink.MAVLink(None, 1, 1)
    seen: list[Seen] = []
    due_s = 0.0
    while not ended.is_set():
        try:
            data, peer = line.recvfrom(2048)
        except TimeoutError:
            continue
        at_s = time.monotonic()
        if at_s >= due_s:
            due_s = at_s + 0.5
            beat = mavlink.MAVLink_heartbeat_message(2, 3, 129, GUIDED, 4, 3)
            line.sendto(beat.pack(codec), peer)
        for message in mavlink.MAVLink(None).parse_buffer(bytearray(data)) or []:
            if message.get_type() == SETPOINT:
                seen += [(at_s, float(message.vx))]
    report.send(seen)


def _burn(ended: threading.Event) -> None:
    number = 1
    while not ended.is_set():
        for _ in range(100_000):
            number = number * 1103515245 % 2147483647


def main(
    seconds: float = 30.0,
    rate: Annotated[float, typer.Option(help='Set-points per second.')] = 10.0,
    workers: Annotated[int, typer.Option(help='Processes that never rest.')] = 2,
) -> None:
    """Measure, print the result as JSON, and exit with status 1 when a limit does not hold."""
    gaps = measure(seconds, rate, workers)
    typer.echo(json.dumps(asdict(gaps)))
    if gaps.p99_ms > P99_MS or gaps.dead_man_ms > DEAD_MAN_MS:
        raise typer.Exit(1)


if __name__ == '__main__':
    typer.run(main)
