# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The web server of the page: what it serves, to whom, and how commands get through.

It listens on 127.0.0.1 only. A page of another origin can neither read what it sends (the host and
the origin of each request are checked) nor command: that takes the token, and a ticket for each
command. Every viewer gets the newest picture when it has taken the last one, so a slow one costs
frames and no memory.
"""

from __future__ import annotations

import asyncio
import json
import socket
import time
from collections.abc import Awaitable, Callable
from concurrent.futures import Future
from pathlib import Path
from typing import Any

import uvicorn
from starlette.applications import Starlette
from starlette.middleware import Middleware
from starlette.middleware.trustedhost import TrustedHostMiddleware
from starlette.requests import Request
from starlette.responses import JSONResponse, Response
from starlette.routing import Route, WebSocketRoute
from starlette.websockets import WebSocket, WebSocketDisconnect

from peace_ros.core.domain import ConfigurationError
from peace_ros.core.threads import GuardedThread, OnDefect
from peace_ros.watch.ledger import Ledger, Picture
from peace_ros.watch.tickets import ACTIONS, TICKET_S, Tickets

HOST = '127.0.0.1'
_PAGE = Path(__file__).with_name('page')
_FILES = {
    '/': ('index.html', 'text/html; charset=utf-8'),
    '/page.css': ('page.css', 'text/css; charset=utf-8'),
    '/page.js': ('page.js', 'text/javascript; charset=utf-8'),
    '/icon.svg': ('icon.svg', 'image/svg+xml'),
    '/drawings.js': ('drawings.js', 'text/javascript; charset=utf-8'),
}
_POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' blob:; "
    "connect-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
)
_HEADERS = [
    ('content-security-policy', _POLICY),
    ('x-content-type-options', 'nosniff'),
    ('referrer-policy', 'no-referrer'),
    ('cache-control', 'no-store'),
]
_LEAST_S = 0.04
"""Between two updates of a viewer."""
_QUIET_S = 0.5
"""Without news an update is sent after this time, so that ages go on."""
_SEND_LIMIT_S = 10.0
"""A viewer that does not take an update for this long is dropped."""
_ANSWER_LIMIT_S = 15.0
_BODY_LIMIT = 1024
_CONNECTIONS_LIMIT = 64
_BACKLOG = 128
_CLOSE_POLICY, _CLOSE_FULL = 1008, 1013
_JOIN_S = 3.0

Command = Callable[[str], 'Future[tuple[bool, str]]']
"""Action -> whether the landing node did it, and its sentence."""


class PageServer:
    """Serves the page from a thread of its own."""

    def __init__(
        self, ledger: Ledger, command: Command, *, port: int, viewers: int, on_defect: OnDefect
    ) -> None:
        """Open the port.

        Args:
            ledger: What is shown.
            command: Asks the landing node.
            port: 0 takes a free one.
            viewers: How many may look at the same time.
            on_defect: Takes what ended the thread.

        Raises:
            ConfigurationError: The port is taken.
        """
        self._ledger, self._command, self._most = ledger, command, viewers
        self.tickets = Tickets()
        self.viewers = 0
        """Pages that are open."""
        self._socket = _listen(port)
        self.port = int(self._socket.getsockname()[1])
        self._loop: asyncio.AbstractEventLoop | None = None
        self._pulse = asyncio.Event()
        self._state: tuple[float, str] = (0.0, '')
        files = {path: (_PAGE / name).read_bytes() for path, (name, _) in _FILES.items()}
        app = Starlette(
            routes=[
                *(Route(path, _file(files[path], kind)) for path, (_, kind) in _FILES.items()),
                Route('/command/prepare', self._prepare, methods=['POST']),
                Route('/command/confirm', self._confirm, methods=['POST']),
                WebSocketRoute('/live', self._show),
            ],
            middleware=[Middleware(TrustedHostMiddleware, allowed_hosts=[HOST, 'localhost'])],
        )
        self._server = uvicorn.Server(
            uvicorn.Config(
                app,
                lifespan='off',
                log_level='error',
                access_log=False,
                headers=_HEADERS,
                server_header=False,
                proxy_headers=False,
                limit_concurrency=_CONNECTIONS_LIMIT,
                ws_max_size=_BODY_LIMIT,
                ws_max_queue=4,
                ws_per_message_deflate=False,
                timeout_graceful_shutdown=1,
            )
        )
        self._thread = GuardedThread(self._run, 'page', on_defect)
        self._thread.start()

    @property
    def url(self) -> str:
        """Address of the page; the token is behind the #, so no browser sends or logs it."""
        return f'http://{HOST}:{self.port}/#token={self.tickets.token}'

    def news(self) -> None:
        """Update the viewers soon; from any thread."""
        if self.viewers and self._loop is not None:
            self._loop.call_soon_threadsafe(self._wake)

    def close(self) -> None:
        """Stop serving."""
        self._server.should_exit = True
        self._thread.join(timeout=_JOIN_S)
        self._socket.close()

    def _run(self) -> None:
        asyncio.run(self._serve())

    async def _serve(self) -> None:
        self._loop = asyncio.get_running_loop()
        await self._server.serve(sockets=[self._socket])

    def _wake(self) -> None:
        pulse, self._pulse = self._pulse, asyncio.Event()
        pulse.set()

    async def _show(self, viewer: WebSocket) -> None:
        """Show a viewer everything until it leaves; it has nothing to say itself."""
        if not _same_origin(viewer.headers.get('origin'), viewer.headers.get('host')):
            await viewer.close(_CLOSE_POLICY)
            return
        await viewer.accept()
        if self.viewers >= self._most:
            await viewer.close(_CLOSE_FULL, f'{self.viewers} pages are open, which is the limit')
            return
        self.viewers += 1
        tasks = {asyncio.ensure_future(each(viewer)) for each in (self._update, _until_it_leaves)}
        try:
            done, _ = await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
        finally:
            self.viewers -= 1
            for each in tasks:
                each.cancel()
            await asyncio.gather(*tasks, return_exceptions=True)
        for each in done:
            error = each.exception()
            if error is not None and not isinstance(error, _LEFT):
                raise error

    async def _update(self, viewer: WebSocket) -> None:
        history = self._ledger.history(time.monotonic())
        await _send(viewer.send_text(json.dumps({'history': history})))
        events = history['events']
        told = events[-1]['number'] if events else 0
        shown = {'overlay': 0, 'ground': 0}
        while True:
            pulse = self._pulse
            text, told = self._news_since(told)
            await _send(viewer.send_text(text))
            for kind, number in shown.items():
                picture: Picture | None = getattr(self._ledger, kind)
                if picture is not None and picture.number > number:
                    shown[kind] = picture.number
                    await _send(viewer.send_bytes(_packed(kind, picture)))
            await asyncio.sleep(_LEAST_S)
            try:
                await asyncio.wait_for(pulse.wait(), _QUIET_S)
            except asyncio.TimeoutError:
                continue

    def _news_since(self, number: int) -> tuple[str, int]:
        """Return the present state, made once for all viewers, and the events after a number."""
        now_s = time.monotonic()
        if now_s - self._state[0] > _LEAST_S / 2.0:
            self._state = now_s, json.dumps(self._ledger.snapshot(now_s))
        with self._ledger.lock:
            new = [each for each in self._ledger.timeline.events if each.number > number]
        events = [
            {'kind': each.kind, 'sentence': each.sentence, 'time_s': each.time_s - now_s}
            for each in new
        ]
        text = f'{{"state": {self._state[1]}, "events": {json.dumps(events)}}}'
        return text, new[-1].number if new else number

    async def _prepare(self, request: Request) -> Response:
        """First step of a command: a ticket, valid once and for ten seconds."""
        given, refusal = await self._given(request)
        if refusal is not None:
            return refusal
        action = given.get('action')
        if action not in ACTIONS:
            return _refused(400, f'action must be one of {", ".join(ACTIONS)}')
        ticket = self.tickets.issue(action, time.monotonic())
        return JSONResponse({'ticket': ticket, 'valid_s': TICKET_S})

    async def _confirm(self, request: Request) -> Response:
        """Second step: the command itself."""
        given, refusal = await self._given(request)
        if refusal is not None:
            return refusal
        action = self.tickets.take(str(given.get('ticket')), time.monotonic())
        if action is None:
            return _refused(409, 'this confirmation was used already or is too old: begin again')
        try:
            answer = asyncio.wrap_future(self._command(action))
            done, sentence = await asyncio.wait_for(answer, _ANSWER_LIMIT_S)
        except asyncio.TimeoutError:
            done, sentence = False, f'no answer from the landing node in {_ANSWER_LIMIT_S:.0f} s'
        self._ledger.note_command(time.monotonic(), f'{action}, asked on the page: {sentence}')
        return JSONResponse({'done': done, 'sentence': sentence})

    async def _given(self, request: Request) -> tuple[dict[str, Any], Response | None]:
        """Return the JSON object of a command, or why it is refused."""
        if not _same_origin(request.headers.get('origin'), request.headers.get('host')):
            return {}, _refused(403, 'commands are taken from this page only')
        scheme, _, token = request.headers.get('authorization', '').partition(' ')
        if scheme != 'Bearer' or not self.tickets.is_token(token):
            return {}, _refused(
                401, 'the token is missing or wrong: open the address that peace watch has printed'
            )
        body = b''
        async for part in request.stream():
            body += part
            if len(body) > _BODY_LIMIT:
                return {}, _refused(413, f'a command has at most {_BODY_LIMIT} bytes')
        try:
            given = json.loads(body)
        except ValueError:
            given = None
        if not isinstance(given, dict):
            return {}, _refused(400, 'a command is a JSON object')
        return given, None


_LEFT = (WebSocketDisconnect, asyncio.TimeoutError, ConnectionError)
"""How a viewer goes."""


def _listen(port: int) -> socket.socket:
    listener = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
    listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        listener.bind((HOST, port))
        listener.listen(_BACKLOG)
    except OSError as error:
        listener.close()
        raise ConfigurationError(
            f'port {port} of {HOST} cannot be opened ({error.strerror}): give another port'
        ) from error
    return listener


def _file(content: bytes, kind: str) -> Callable[[Request], Awaitable[Response]]:
    async def serve(_request: Request) -> Response:
        return Response(content, media_type=kind)

    return serve


def _same_origin(origin: str | None, host: str | None) -> bool:
    """Tell whether a browser sent the request from our own page, over http or a tunnel with TLS."""
    return host is not None and origin in {f'http://{host}', f'https://{host}'}


def _refused(status: int, sentence: str) -> Response:
    return JSONResponse({'done': False, 'sentence': sentence}, status_code=status)


async def _until_it_leaves(viewer: WebSocket) -> None:
    """Return when the viewer leaves, or says something, for which there is no use."""
    if (await viewer.receive())['type'] == 'websocket.receive':
        await viewer.close(_CLOSE_POLICY)


async def _send(sending: Awaitable[None]) -> None:
    await asyncio.wait_for(sending, _SEND_LIMIT_S)


def _packed(kind: str, picture: Picture) -> bytes:
    """Return a picture behind its description: 4 bytes with its length, JSON, the picture."""
    age_s = time.monotonic() - picture.heard_s
    meta = json.dumps({'kind': kind, 'age_s': round(age_s, 3), **picture.meta}).encode()
    return len(meta).to_bytes(4, 'big') + meta + picture.data
