# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A frame gets the prompt made from it, and waits for it only as long as it may."""

from __future__ import annotations

import threading
import time

import pytest

from peace_ros.core.domain import Prompt
from peace_ros.core.node_parameters import SegmentationOptions
from peace_ros.nodes import prompts
from peace_ros.nodes.messages import prompt_to_message
from peace_ros.nodes.prompts import PromptBoard, PromptInput


def prompt(stamp_ns: int) -> Prompt:
    return Prompt(f'{{term}} {stamp_ns}', stamp_ns)


def test_pairs_by_stamp_even_when_newer_prompts_are_there():
    board = PromptBoard()
    for stamp_ns in (1, 2, 3):
        board.put(prompt(stamp_ns))
    assert board.take(2, 0.0) == prompt(2)


def test_nothing_before_the_first_prompt():
    board = PromptBoard()
    assert board.is_empty
    assert board.take(1, 0.01) is None


def test_waits_for_its_prompt_as_long_as_it_takes_within_the_limit():
    board = PromptBoard()
    board.put(prompt(1))
    threading.Timer(0.05, lambda: board.put(prompt(2))).start()
    assert board.take(2, 10.0) == prompt(2)


def test_takes_the_newest_when_the_time_is_over():
    board = PromptBoard()
    board.put(prompt(1))
    begun = time.monotonic()
    assert board.take(5, 0.05) == prompt(1)
    assert 0.04 <= time.monotonic() - begun < 2.0


def test_does_not_wait_for_a_frame_that_was_passed_over():
    board = PromptBoard()
    board.put(prompt(9))
    begun = time.monotonic()
    assert board.take(5, 10.0) == prompt(9)
    assert time.monotonic() - begun < 5.0


def test_forgets_old_prompts():
    board = PromptBoard()
    for stamp_ns in range(1000):
        board.put(prompt(stamp_ns))
    assert board.take(0, 0.0) == prompt(999)


def test_closing_lets_who_waits_go():
    board = PromptBoard()
    threading.Timer(0.05, board.close).start()
    begun = time.monotonic()
    assert board.take(1, 30.0) is None
    assert time.monotonic() - begun < 10.0


MS = 1_000_000


def test_after_a_frame_in_vain_it_waits_no_longer_until_a_prompt_is_in_time_again():
    board = PromptBoard()
    board.put(prompt(0))
    waits = []
    for number in range(1, 7):
        begun = time.monotonic()
        assert board.take(100 * MS * number, 0.2) == prompt(0)
        waits.append(time.monotonic() - begun)
    assert waits[0] > 0.15
    assert max(waits[1:]) < 0.1
    # One that is 3 s late is no sign of a generator that keeps up.
    board.put(prompt(600 * MS - 3000 * MS))
    begun = time.monotonic()
    board.take(700 * MS, 0.2)
    assert time.monotonic() - begun < 0.1
    board.put(prompt(600 * MS))
    threading.Timer(0.05, lambda: board.put(prompt(800 * MS))).start()
    assert board.take(800 * MS, 10.0) == prompt(800 * MS)


class Subscriber:
    """What a prompt input asks of its node."""

    diagnostics = property(lambda self: self)

    def watch(self, _topic, unless):
        assert not unless()
        return lambda _stamp_ns: None

    def create_subscription(self, _kind, _topic, callback, _profile):
        self.publish = callback

    def fail(self, error):
        raise error


@pytest.fixture
def embedded():
    return []


@pytest.fixture
def subscriber():
    return Subscriber()


@pytest.fixture
def prompt_input(subscriber, embedded):
    prompt_input = PromptInput(subscriber, SegmentationOptions(), embedded.append, pytest.fail)
    yield prompt_input
    prompt_input.close()


def hear(subscriber: Subscriber, prompt_input: PromptInput, sentence: str, stamp_ns: int) -> None:
    subscriber.publish(prompt_to_message(Prompt(sentence, stamp_ns)))
    deadline = time.monotonic() + 5.0
    while prompt_input.take(stamp_ns) != (Prompt(sentence, stamp_ns), True):
        assert time.monotonic() < deadline


def test_a_sentence_is_embedded_once_while_few_are_used(subscriber, prompt_input, embedded):
    for number in range(6):
        hear(subscriber, prompt_input, f'{{term}} {number % 2}', number)
    assert len(embedded) == 2


def test_a_flood_of_sentences_does_not_fill_the_memory(
    subscriber, prompt_input, embedded, monkeypatch
):
    monkeypatch.setattr(prompts, '_REMEMBERED', 3)
    for number in range(12):
        hear(subscriber, prompt_input, f'{{term}} {number}', number)
        assert len(prompt_input._embedded) <= 3
    assert len(embedded) == 12
