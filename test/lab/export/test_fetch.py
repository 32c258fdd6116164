# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Downloads continue where they stopped; only complete, unchanged bundles are put in place."""

from __future__ import annotations

import errno
import functools
import hashlib
import http.server
import json
import sys
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip('pooch')

from peace_ros.core.domain import BundleError
from peace_ros.core.inference import Bundle
from peace_ros.lab.export import fetch
from peace_ros.lab.export.fetch import fetch_bundle
from peace_ros.lab.export.staging import put_in_place


class RangeHandler(http.server.SimpleHTTPRequestHandler):
    """Serves files and the rest of files, and remembers what was asked for."""

    asked: list[tuple[str, str]]

    def do_GET(self) -> None:
        wanted = self.headers.get('Range', '')
        self.server.asked.append((self.path, wanted))  # type: ignore[attr-defined]
        if not wanted:
            super().do_GET()
            return
        content = Path(self.translate_path(self.path)).read_bytes()
        part = content[int(wanted.removeprefix('bytes=').removesuffix('-')) :]
        self.send_response(206)
        self.send_header('Content-Length', str(len(part)))
        self.end_headers()
        self.wfile.write(part)

    def log_message(self, *_: Any) -> None:
        pass


@pytest.fixture
def bundle_folder(tiny: Any, tmp_path: Path) -> Path:
    folder: Path = tiny.write_bundle(tmp_path / 'site' / 'v1', 'clip')
    digest = hashlib.sha256((folder / 'manifest.json').read_bytes()).hexdigest()
    index = {'clip-tiny': {'url': 'v1', 'sha256': digest}}
    (tmp_path / 'site' / 'index.json').write_text(json.dumps(index))
    return folder


@pytest.fixture
def server(bundle_folder: Path) -> Iterator[Any]:
    handler = functools.partial(RangeHandler, directory=str(bundle_folder.parent))
    with http.server.ThreadingHTTPServer(('127.0.0.1', 0), handler) as running:
        running.asked = []  # type: ignore[attr-defined]
        threading.Thread(target=running.serve_forever, daemon=True).start()
        yield running
        running.shutdown()


def url_of(server: Any) -> str:
    return f'http://127.0.0.1:{server.server_port}/index.json'


def no_progress(file: str, have: int, size: int) -> None:
    pass


def test_a_bundle_is_fetched_by_name(server: Any, tmp_path: Path) -> None:
    seen = []
    bundle = fetch_bundle(
        'clip-tiny', url_of(server), tmp_path / 'here', lambda *step: seen.append(step)
    )
    assert bundle.manifest.family == 'clip'
    assert {file for file, have, size in seen if have == size} == set(bundle.manifest.files)
    assert [each.name for each in tmp_path.iterdir() if each.name.startswith('.')] == []


def test_an_interrupted_download_goes_on(server: Any, bundle_folder: Path, tmp_path: Path) -> None:
    part = tmp_path / '.here.part'
    part.mkdir()
    whole = (bundle_folder / 'image_encoder.onnx').read_bytes()
    (part / 'image_encoder.onnx').write_bytes(whole[:100])
    fetch_bundle('clip-tiny', url_of(server), tmp_path / 'here', no_progress)
    assert ('/v1/image_encoder.onnx', 'bytes=100-') in server.asked
    assert (tmp_path / 'here' / 'image_encoder.onnx').read_bytes() == whole


def test_a_changed_file_is_refused_and_the_old_bundle_stays(
    server: Any, bundle_folder: Path, tmp_path: Path
) -> None:
    old = fetch_bundle('clip-tiny', url_of(server), tmp_path / 'here', no_progress)
    file = bundle_folder / 'text_encoder.onnx'
    content = bytearray(file.read_bytes())
    content[50] ^= 1
    file.write_bytes(bytes(content))
    with pytest.raises(BundleError, match=r'text_encoder\.onnx: its SHA-256 is not the announced'):
        fetch_bundle('clip-tiny', url_of(server), tmp_path / 'here', no_progress)
    assert old.load(tmp_path / 'here').checksum == old.checksum


def test_a_cut_file_is_refused_and_nothing_bears_the_name(
    server: Any, bundle_folder: Path, tmp_path: Path
) -> None:
    file = bundle_folder / 'text_encoder.onnx'
    file.write_bytes(file.read_bytes()[:-10])
    with pytest.raises(BundleError, match=r'not the announced .* call again or ask'):
        fetch_bundle('clip-tiny', url_of(server), tmp_path / 'here', no_progress)
    assert not (tmp_path / 'here').exists()


def test_a_download_stops_at_the_announced_size(
    server: Any, bundle_folder: Path, tmp_path: Path
) -> None:
    file = bundle_folder / 'text_encoder.onnx'
    size = file.stat().st_size
    with file.open('ab') as longer:
        longer.truncate(200 << 20)
    seen = []
    with pytest.raises(BundleError, match=f'more than the announced {size} bytes came'):
        fetch_bundle(
            'clip-tiny', url_of(server), tmp_path / 'here', lambda *step: seen.append(step)
        )
    assert all(have <= most for _, have, most in seen)
    kept = list((tmp_path / '.here.part').iterdir())
    assert not [each for each in kept if each.name.startswith('text_encoder')]
    assert max(each.stat().st_size for each in kept) < 1 << 20
    assert not (tmp_path / 'here').exists()


def test_a_server_that_ignores_ranges_sends_the_file_again(
    bundle_folder: Path, tmp_path: Path
) -> None:
    class PlainHandler(RangeHandler):
        def do_GET(self) -> None:
            del self.headers['Range']
            super().do_GET()

    part = tmp_path / '.here.part'
    part.mkdir()
    (part / 'image_encoder.onnx').write_bytes(b'other')
    handler = functools.partial(PlainHandler, directory=str(bundle_folder.parent))
    with http.server.ThreadingHTTPServer(('127.0.0.1', 0), handler) as running:
        running.asked = []  # type: ignore[attr-defined]
        threading.Thread(target=running.serve_forever, daemon=True).start()
        assert fetch_bundle('clip-tiny', url_of(running), tmp_path / 'here', no_progress)
        running.shutdown()


def test_without_pooch_the_extra_that_brings_it_is_named(
    server: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, 'pooch', None)
    with pytest.raises(BundleError, match=r'downloads need pooch: .*\[fetch\]'):
        fetch_bundle('clip-tiny', url_of(server), tmp_path / 'here', no_progress)


def test_a_broken_connection_keeps_what_came_and_the_next_call_goes_on(
    bundle_folder: Path, tmp_path: Path
) -> None:
    class BreakingHandler(RangeHandler):
        def do_GET(self) -> None:
            if self.path.endswith('text_encoder.onnx') and not self.server.broken:
                self.server.broken = True
                content = Path(self.translate_path(self.path)).read_bytes()
                self.send_response(200)
                self.send_header('Transfer-Encoding', 'chunked')
                self.end_headers()
                self.wfile.write(b'%x\r\n%s\r\n' % (100, content[:100]) + b'40\r\ncut')
                self.close_connection = True
                return
            super().do_GET()

    handler = functools.partial(BreakingHandler, directory=str(bundle_folder.parent))
    with http.server.ThreadingHTTPServer(('127.0.0.1', 0), handler) as running:
        running.asked, running.broken = [], False
        threading.Thread(target=running.serve_forever, daemon=True).start()
        with pytest.raises(BundleError, match=r'text_encoder.* call again'):
            fetch_bundle('clip-tiny', url_of(running), tmp_path / 'here', no_progress)
        assert (tmp_path / '.here.part' / 'manifest.json').is_file()
        assert fetch_bundle('clip-tiny', url_of(running), tmp_path / 'here', no_progress)
        running.shutdown()


def test_an_unknown_name_lists_those_there_are(server: Any, tmp_path: Path) -> None:
    with pytest.raises(BundleError, match=r"no bundle 'clip-huge' .* it has clip-tiny"):
        fetch_bundle('clip-huge', url_of(server), tmp_path / 'here', no_progress)


def test_no_network_is_said_and_the_old_bundle_stays(server: Any, tmp_path: Path) -> None:
    old = fetch_bundle('clip-tiny', url_of(server), tmp_path / 'here', no_progress)
    with pytest.raises(BundleError, match=r'cannot be read .* check --index and the network'):
        fetch_bundle('clip-tiny', 'http://127.0.0.1:9/index.json', tmp_path / 'here', no_progress)
    assert Bundle.load(tmp_path / 'here').checksum == old.checksum


def test_a_full_disk_is_said_and_the_old_bundle_stays(
    server: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    old = fetch_bundle('clip-tiny', url_of(server), tmp_path / 'here', no_progress)

    def full(*_: Any) -> None:
        raise OSError(errno.ENOSPC, 'No space left on device')

    monkeypatch.setattr(fetch, '_retrieve', full)
    with pytest.raises(BundleError, match=r'here: No space left on device; free some space'):
        fetch_bundle('clip-tiny', url_of(server), tmp_path / 'here', no_progress)
    assert Bundle.load(tmp_path / 'here').checksum == old.checksum


@pytest.mark.parametrize(
    ('index', 'told'),
    [
        ('nowhere/index.json', r'index\.json: cannot be read .*No such file.*; check --index'),
        ('ftp://nowhere/index.json', 'give a URL that begins with http, https, file'),
        (
            'http://127.0.0.1:9/index.json',
            r'refused.*; check --index and the network, then',
        ),
    ],
)
def test_an_index_that_cannot_be_read_is_refused(tmp_path: Path, index: str, told: str) -> None:
    with pytest.raises(BundleError, match=told):
        fetch_bundle('clip-tiny', index, tmp_path / 'here', no_progress)
    assert not list(tmp_path.iterdir())


def test_a_server_without_the_files_says_whom_to_ask(
    server: Any, bundle_folder: Path, tmp_path: Path
) -> None:
    (bundle_folder / 'text_encoder.onnx').unlink()
    with pytest.raises(BundleError, match=r'404 .*; check --index and the network'):
        fetch_bundle('clip-tiny', url_of(server), tmp_path / 'here', no_progress)


def test_an_index_on_disk_will_do(bundle_folder: Path, tmp_path: Path) -> None:
    index = str(bundle_folder.parent / 'index.json')
    assert fetch_bundle('clip-tiny', index, tmp_path / 'here', no_progress)


def test_two_downloads_of_one_bundle_do_not_mix(server: Any, tmp_path: Path) -> None:
    def meanwhile(_file: str, _have: int, _size: int) -> None:
        with pytest.raises(BundleError, match='another download of this bundle is under way'):
            fetch_bundle('clip-tiny', url_of(server), tmp_path / 'here', no_progress)

    fetch_bundle('clip-tiny', url_of(server), tmp_path / 'here', meanwhile)
    assert Bundle.load(tmp_path / 'here').manifest.family == 'clip'


def test_a_symbolic_link_in_the_way_is_not_followed(server: Any, tmp_path: Path) -> None:
    outside = tmp_path / 'precious'
    outside.write_bytes(b'mine')
    parts = tmp_path / '.here.part'
    parts.mkdir()
    (parts / 'image_encoder.onnx').symlink_to(outside)
    fetch_bundle('clip-tiny', url_of(server), tmp_path / 'here', no_progress)
    assert outside.read_bytes() == b'mine'
    assert not any(each.is_symlink() for each in (tmp_path / 'here').iterdir())
    parts.symlink_to(tmp_path)
    with pytest.raises(BundleError, match='is a symbolic link: remove it'):
        fetch_bundle('clip-tiny', url_of(server), tmp_path / 'here', no_progress)


@pytest.mark.parametrize(
    ('before', 'after', 'is_refused'),
    [
        ('https://a/i.json', 'http://a/b/', True),
        ('https://a/i.json', 'file:///etc/', True),
        ('http://a/i.json', 'file:///etc/', True),
        ('http://a/i.json', 'https://b/', False),
        ('https://a/i.json', 'https://b/', False),
        ('file:///i.json', 'http://b/', False),
    ],
)
def test_a_less_safe_kind_of_address_is_refused(before: str, after: str, is_refused: bool) -> None:
    if is_refused:
        with pytest.raises(BundleError, match='or https may follow'):
            fetch._refuse_less_safe(before, after)
    else:
        fetch._refuse_less_safe(before, after)


def test_a_download_without_an_end_is_given_up(
    server: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(fetch, '_LONGEST_S', -1.0)
    with pytest.raises(BundleError, match='call again, it continues'):
        fetch_bundle('clip-tiny', url_of(server), tmp_path / 'here', no_progress)


def test_an_index_that_is_a_device_is_not_read(tmp_path: Path) -> None:
    with pytest.raises(BundleError, match='is not a file of at most'):
        fetch_bundle('clip-tiny', '/dev/zero', tmp_path / 'here', no_progress)


def test_the_name_of_a_bundle_never_vanishes_while_it_is_replaced(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in ('new', 'old'):
        (tmp_path / name).mkdir()
        (tmp_path / name / name).touch()

    def never(*_: Any) -> None:
        raise AssertionError('a step in which the name is missing')

    monkeypatch.setattr(Path, 'rename', never)
    put_in_place(tmp_path / 'new', tmp_path / 'old')
    assert [each.name for each in (tmp_path / 'old').iterdir()] == ['new']
    assert [each.name for each in tmp_path.iterdir()] == ['old']
