# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The page in a real browser: what a person reads, by mouse, keyboard and screen reader."""

from __future__ import annotations

import os
import shutil
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any

import pytest

playwright = pytest.importorskip('playwright.sync_api', reason='Playwright is not installed')
axe = pytest.importorskip('axe_playwright_python.sync_playwright')

BROWSER = shutil.which('chromium') or shutil.which('google-chrome') or shutil.which('chrome')
SIZES = {'phone': (390, 844), 'desk': (1440, 900)}
PICTURES = os.environ.get('PEACE_PICTURES')
"""Folder that gets a picture of each state, for a person to look at."""


@pytest.fixture(scope='module')
def browser() -> Iterator[Any]:
    with playwright.sync_playwright() as run:
        try:
            browser = run.chromium.launch(executable_path=BROWSER, args=['--no-sandbox'])
        except playwright.Error:
            pytest.skip('no Chromium: apt install chromium, or playwright install chromium')
        yield browser
        browser.close()


class Visit:
    """A page that is open, and what its console complains of."""

    def __init__(self, browser: Any, served: Any, size: str, theme: str, *, token: bool) -> None:
        width, height = SIZES[size]
        self._context = browser.new_context(
            viewport={'width': width, 'height': height}, color_scheme=theme
        )
        self.page = self._context.new_page()
        self.complaints: list[str] = []
        self.page.on('console', lambda each: self.complaints.append(each.text))
        self.page.on('pageerror', lambda each: self.complaints.append(str(each)))
        self.page.goto(served.server.url if token else served.base)

    def read(self, name: str) -> str:
        return self.page.locator(f'#{name}').inner_text()

    def shows(self, name: str, text: str) -> None:
        playwright.expect(self.page.locator(f'#{name}')).to_contain_text(text, timeout=5000)

    def close(self) -> None:
        self._context.close()


@pytest.fixture
def visit(browser: Any, served: Any) -> Iterator[Any]:
    visits: list[Visit] = []

    def open_page(size: str = 'desk', theme: str = 'light', *, token: bool = True) -> Visit:
        visits.append(Visit(browser, served, size, theme, token=token))
        return visits[-1]

    yield open_page
    for each in visits:
        each.close()
        assert each.complaints == []


@pytest.mark.parametrize(('size', 'theme'), [('phone', 'dark'), ('desk', 'light')])
@pytest.mark.parametrize('scene', ['searching', 'aiming', 'hold'])
def test_says_where_it_lands_why_not_nearer_and_what_stops_it(
    served, scenes, visit, size, theme, scene
):
    scenes.fill(served.ledger)
    served.keep(scene)
    seen = visit(size, theme)
    seen.shows('state', scenes.SCENES[scene]['state'])
    seen.shows('reason', scenes.SCENES[scene]['reason'][1:])
    if scene == 'searching':
        seen.shows('where', 'nowhere yet: the widest safe ground is too narrow by 1.2 m')
    else:
        seen.shows('where', '9.3 m of clearance')
    if scene != 'hold':
        seen.shows('nearer', '10 m away: too narrow by 1.2 m')
        assert seen.page.locator('#refused li').count() == 2
    seen.page.locator('#overlay').wait_for()
    for name in ('state', 'words', 'reason', 'where', 'nearer', 'stops'):
        box = seen.page.locator(f'#{name}').bounding_box()
        assert box['y'] + box['height'] <= SIZES[size][1], f'{name} is in the first view'
    wide = seen.page.evaluate('document.documentElement.scrollWidth')
    assert wide <= SIZES[size][0], 'nothing scrolls sideways'
    if PICTURES:
        folder = Path(PICTURES)
        folder.mkdir(parents=True, exist_ok=True)
        seen.page.screenshot(path=folder / f'{scene}-{size}-{theme}.png')


@pytest.mark.parametrize('size', SIZES)
@pytest.mark.parametrize('theme', ['light', 'dark'])
def test_axe_finds_no_barrier(served, scenes, visit, size, theme):
    scenes.fill(served.ledger)
    for scene in scenes.SCENES:
        served.show(scene)
        seen = visit(size, theme)
        seen.shows('state', scenes.SCENES[scene]['state'])
        assert_no_barrier(seen.page)
        seen.close()


def test_axe_finds_no_barrier_in_old_news(served, scenes, visit):
    scenes.fill(served.ledger)
    served.show('aiming')
    seen = visit()
    seen.page.wait_for_selector('body.old')
    assert_no_barrier(seen.page)


def hover(mark: Any) -> None:
    """Point at a mark, which may just be drawn anew."""
    for _ in range(20):
        with suppress(playwright.Error):
            mark.hover(force=True, timeout=1000)
            return
    raise AssertionError(f'nothing to point at: {mark}')


def assert_no_barrier(page: Any) -> None:
    found = axe.Axe().run(page)
    assert found.violations_count == 0, found.generate_report()


def test_a_refused_place_gives_its_reason_under_the_pointer_and_by_the_keyboard(
    served, scenes, visit
):
    scenes.fill(served.ledger)
    served.keep('aiming')
    seen = visit()
    mark = seen.page.locator('#map [data-kind="refused 2"]')
    mark.wait_for()
    hover(mark)
    seen.shows('map-caption', 'something clearly unsafe was seen there 3 s ago')
    seen.page.locator('#camera-marks [data-kind="refused 1"]').focus()
    seen.shows('camera-caption', 'too narrow by 1.2 m')


def test_the_keyboard_reaches_every_place_and_stays_there_while_the_map_is_drawn_anew(
    served, scenes, visit
):
    scenes.fill(served.ledger)
    served.keep('aiming')
    seen = visit()
    mark = seen.page.locator('#map [data-kind="site"]')
    mark.focus()
    seen.page.wait_for_timeout(600)
    assert seen.page.evaluate('document.activeElement.dataset.kind') == 'site'


def test_engaging_takes_two_steps_and_tells_the_answer(served, scenes, visit):
    served.keep('idle')
    seen = visit()
    seen.shows('state', 'IDLE')
    assert 'token' not in seen.page.url
    seen.page.get_by_role('button', name='Engage the landing').click()
    dialog = seen.page.get_by_role('dialog')
    dialog.wait_for()
    assert served.commands == []
    assert seen.page.evaluate('document.activeElement.id') == 'ask-no'
    dialog.get_by_role('button', name='Cancel').click()
    seen.shows('answer', 'nothing was done')
    seen.page.get_by_role('button', name='Engage the landing').press('Enter')
    dialog.get_by_role('button', name='Yes, engage').press('Enter')
    seen.shows('answer', 'Done: engaged')
    assert served.commands == ['engage']


def test_without_the_token_nothing_can_be_commanded(served, visit):
    served.show('aiming')
    seen = visit(token=False)
    seen.shows('state', 'AIMING')
    playwright.expect(seen.page.locator('#disengage')).to_be_disabled()
    seen.shows('answer', 'need the address with its token')


def test_a_silent_landing_node_makes_the_page_old_and_commands_impossible(served, visit):
    served.show('landing')
    seen = visit()
    seen.shows('state', 'LANDING')
    seen.shows('problem', 'anding/status is silent for')
    seen.shows('announce', 'landing/status is silent for')
    playwright.expect(seen.page.locator('#engage')).to_be_disabled()


def test_before_any_node_runs_the_page_says_what_to_do(visit):
    seen = visit()
    seen.shows('problem', 'start the landing node')
    seen.shows('state', 'UNKNOWN')


def test_a_server_that_ends_is_said_on_the_page(served, visit):
    served.show('landing')
    seen = visit()
    seen.shows('state', 'LANDING')
    served.server.close()
    seen.shows('problem', 'No connection to peace watch for')
    playwright.expect(seen.page.locator('#disengage')).to_be_disabled()
    seen.complaints.clear()  # the browser complains of each connection that fails


def test_the_past_can_be_read_back(served, scenes, visit):
    scenes.fill(served.ledger)
    served.keep('aiming')
    seen = visit()
    seen.shows('state', 'AIMING')
    seen.page.locator('#back').fill('-150')
    seen.shows('then', '2:30 ago: SEARCHING')
    seen.page.locator('#back').press('End')
    seen.shows('then', 'now')
    seen.shows('events', 'AIMING: Flying over the chosen place')


def test_what_comes_from_topics_is_text_and_never_markup(served, scenes, visit):
    values = scenes.status_of('aiming')
    values['reason'] = values['refused/1/reason'] = '<img src=x onerror=alert(1)>'
    served.show('aiming')
    served.ledger.hear_status(values, 0, served.ledger._status_s)
    seen = visit()
    seen.shows('reason', '<img src=x onerror=alert(1)>')
    seen.shows('refused', '<img src=x')
    assert seen.page.locator('#reason img, #refused img').count() == 0
