# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The prompts for the frames: those of the topic, or the one of a static template."""

from __future__ import annotations

import threading
from collections import OrderedDict
from collections.abc import Callable

from diagnostic_msgs.msg import DiagnosticArray

from peace_ros.core.domain import PeaceError, Prompt
from peace_ros.core.messages import prompt_from_message, stamp_ns_of
from peace_ros.core.node_parameters import SegmentationOptions
from peace_ros.core.prompting import categories_of, resolve_template
from peace_ros.nodes.node import PeaceNode
from peace_ros.nodes.qos import RESULT
from peace_ros.nodes.worker import NewestWorker

_KEPT = 64
"""Prompts that wait; more frames than this never lie between a frame and its prompt."""
_REMEMBERED = 1024
"""Sentences that are known to be embedded; with more, all are looked up again."""


def static_prompt(options: SegmentationOptions) -> Prompt | None:
    """Return the prompt of a template without vocabulary words, None when prompts are awaited."""
    template = resolve_template(options.template)
    return None if categories_of(template) else Prompt(template, 0)


def prompt_of_another_frame(prompt: Prompt, at_ns: int, timeout_s: float) -> str:
    """Return the sentence about a frame (its stamp) that got the prompt of another one."""
    age_s = (at_ns - prompt.stamp_ns) / 1e9
    if age_s > 0.0:
        return (
            f'no prompt for this frame within {timeout_s} s: using the one made {age_s:.2f} s '
            'before it'
        )
    return f'the prompt generator skipped this frame: using the prompt made {-age_s:.2f} s after it'


class PromptBoard:
    """Pairs prompts with frames by stamp; may be used from several threads."""

    def __init__(self) -> None:
        self._changed = threading.Condition()
        self._prompts: OrderedDict[int, Prompt] = OrderedDict()
        self._closed = False
        self._in_vain = False
        self._asked_ns = self._longest_ns = 0

    def put(self, prompt: Prompt) -> None:
        """Add a prompt; the oldest ones are dropped. After one in time, frames wait again."""
        with self._changed:
            if self._asked_ns - prompt.stamp_ns <= self._longest_ns:
                self._in_vain = False
            self._prompts[prompt.stamp_ns] = prompt
            self._prompts.move_to_end(prompt.stamp_ns)
            while len(self._prompts) > _KEPT:
                self._prompts.popitem(last=False)
            self._changed.notify_all()

    def close(self) -> None:
        """Release all waiting callers."""
        with self._changed:
            self._closed = True
            self._changed.notify_all()

    @property
    def is_empty(self) -> bool:
        """No prompt has arrived yet."""
        with self._changed:
            return not self._prompts

    def take(self, stamp_ns: int, timeout_s: float) -> Prompt | None:
        """Return the prompt made from the frame of that stamp, else the newest there is.

        Waits for it at most the timeout (steady clock), and not at all once a prompt of a later
        frame is there: the generator has then skipped this frame. Nor does it wait when the frame
        before timed out: a generator that has stopped must not delay every heatmap. None before
        the first prompt.
        """
        with self._changed:
            self._asked_ns, self._longest_ns = stamp_ns, round(timeout_s * 1e9)
            wait_s = 0.0 if self._in_vain else timeout_s
            self._changed.wait_for(lambda: self._closed or self._decided(stamp_ns), wait_s)
            self._in_vain = not self._decided(stamp_ns)
            if stamp_ns in self._prompts:
                return self._prompts[stamp_ns]
            return next(reversed(self._prompts.values()), None)

    def _decided(self, stamp_ns: int) -> bool:
        if stamp_ns in self._prompts:
            return True
        return bool(self._prompts) and next(reversed(self._prompts)) > stamp_ns


class PromptInput:
    """Subscribes to ``prompt`` and gives each frame its own.

    Args:
        node: subscribes.
        options: template and timeout.
        embed: embeds the texts of a new sentence, in a thread of its own.
        complain: takes what is wrong with a prompt.
        subscribe: they come over the topic; otherwise by :meth:`take_own`.
    """

    def __init__(
        self,
        node: PeaceNode,
        options: SegmentationOptions,
        embed: Callable[[Prompt], None],
        complain: Callable[[PeaceError], None],
        *,
        subscribe: bool = True,
    ) -> None:
        self.static = static_prompt(options)
        """In place of prompts from the topic, None when they are awaited."""
        self._options, self._embed, self._complain = options, embed, complain
        self._board = PromptBoard()
        self._embedded: set[str] = set()
        self._worker = NewestWorker(self._prepare, complain, node.fail, 'prepare')
        self._arrived = node.diagnostics.watch(
            'prompt', unless=lambda: '' if self.static is None else 'not used: static template'
        )
        if subscribe:
            node.create_subscription(DiagnosticArray, 'prompt', self._on_prompt, RESULT)

    @property
    def is_empty(self) -> bool:
        """A frame would get no prompt, for none has arrived yet."""
        return self.static is None and self._board.is_empty

    def take(self, at_ns: int) -> tuple[Prompt, bool] | None:
        """Return the prompt for a frame and whether it was made from that frame."""
        static = self.static
        if static is not None:
            return static, True
        prompt = self._board.take(at_ns, self._options.prompt_timeout)
        return None if prompt is None else (prompt, prompt.stamp_ns == at_ns)

    def change(self, options: SegmentationOptions) -> None:
        """Use another template or timeout; texts may be others, too."""
        self._options, self.static = options, static_prompt(options)
        self._embedded.clear()

    def close(self) -> None:
        """Stop."""
        self._board.close()
        self._worker.close()

    def take_own(self, prompt: Prompt) -> None:
        """Take a prompt that was made in this process; from any thread."""
        self._arrived(prompt.stamp_ns)
        if self.static is None:
            self._put(prompt)

    def _on_prompt(self, message: DiagnosticArray) -> None:
        self._arrived(stamp_ns_of(message))
        if self.static is not None:
            return
        try:
            prompt = prompt_from_message(message)
        except PeaceError as error:
            self._complain(error)
            return
        self._put(prompt)

    def _put(self, prompt: Prompt) -> None:
        # A new sentence is embedded in another thread; frames use the last one until then.
        if prompt.template in self._embedded:
            self._board.put(prompt)
        else:
            self._worker.offer(prompt)

    def _prepare(self, prompt: Prompt) -> None:
        self._embed(prompt)
        if len(self._embedded) >= _REMEMBERED:
            self._embedded.clear()
        self._embedded.add(prompt.template)
        self._board.put(prompt)
