# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Prompts are kept here for the frames that they were made from."""

from __future__ import annotations

import threading
from collections import OrderedDict

from peace_ros.core.domain import Prompt
from peace_ros.core.node_parameters import SegmentationOptions
from peace_ros.core.prompting import categories_of, resolve_template

_KEPT = 64
"""Prompts that wait; more frames than this never lie between a frame and its prompt."""


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
