# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Whether a landing did what it had to: from the ground truth and the wire, not from its word."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from math import isfinite, isnan

from peace_ros.core.landing import State
from peace_ros.lab.faults.fault import ABSENT, Expected, Fault
from peace_ros.lab.faults.record import STANDING_M_S, STILL, Record

FLOOR_M = 20.0
OVERSHOOT_M = 1.0
"""The hand-over may be this much too low."""
SILENCE_S = 1.5
"""A landing node that says nothing for so long, although it runs, hangs."""
MOST_BLIND_S = 0.5
"""Ground truth comes at 50 Hz: where it is missing for longer, nothing proves a standstill."""
CHANGE_S = 0.25
"""Status comes at 10 Hz and set-points at 20 Hz: so long a set-point may belong to the state
before."""


@dataclass(frozen=True)
class Row:
    """The result of one fault, as in the report."""

    name: str
    group: str
    injected: str
    """State, true altitude and time since the engagement."""
    expected: str
    within_s: float
    happened: str
    took_s: float | None
    """From the injection to the expected state; None when none is asked for or it never came."""
    recovered_s: float | None
    """From the end of the fault to the state of the recovery."""
    still_after_s: float
    """From the injection until the vehicle truly stopped descending."""
    max_descent_m_s: float
    """Highest true downward speed from the moment on at which it has to be still."""
    lowest_m: float | None
    """Lowest true altitude since the injection."""
    handovers: int
    unsafe_handovers: int
    crashes: int
    hangs: int
    passed: bool
    failures: tuple[str, ...] = ()
    states: tuple[str, ...] = ()
    """In order, since the injection."""
    attempts: int = 1
    """Flights that were begun: a second one where the first gave no verdict."""
    slow: str = ''
    """What shows that the machine was too slow during one of them, empty when it kept up."""
    figures: dict[str, float] = field(default_factory=dict)
    """Measured on the wire, seconds since the injection; see :func:`wire_figures`."""


def judge(fault: Fault, record: Record) -> Row:
    """Compare what was seen with what the fault asks for, and with what no fault may cause."""
    expected = fault.expected
    failures = [record.trouble] if record.trouble else []
    if not record.trouble:
        for rule in (*_RULES, *_ALWAYS):
            failures.extend(rule(expected, record))
    reached = record.first(expected.reaches) if expected.reaches else None
    again = None
    if expected.recovers and record.ended_s is not None:
        again = record.first(expected.recovers, record.ended_s)
    must_be_still_s = expected.still_within_s if expected.still_within_s is not None else 0.0
    lowest_m = record.lowest_m()
    return Row(
        name=fault.name,
        group=fault.group,
        injected=_injected(record),
        expected=describe(fault),
        within_s=expected.within_s,
        happened=_happened(record),
        took_s=None if reached is None else round(reached.at_s, 2),
        recovered_s=None if again is None else round(again.at_s - record.fault_end_s, 2),
        still_after_s=round(record.still_since_s(record.fault_end_s, STANDING_M_S), 2),
        max_descent_m_s=round(record.fastest_descent_m_s(must_be_still_s, record.fault_end_s), 2),
        lowest_m=None if isnan(lowest_m) else round(lowest_m, 2),
        handovers=record.handovers,
        unsafe_handovers=len(record.unsafe),
        crashes=len(list(_crashes(expected, record))),
        hangs=len(list(_hangs(expected, record))),
        passed=not failures,
        failures=tuple(failures),
        states=_states(record),
        slow=record.slow,
        figures=wire_figures(record),
    )


def wire_figures(record: Record) -> dict[str, float]:
    """Return when the last set-point and the last one that was not zero left the companion.

    Of set-points only what was sent before the fault ended counts; a key is missing where nothing
    was. Also when the first process ended by itself, and with a person below, for how long the
    vehicle descended over them.
    """
    during = [s for s in record.sent if s.at_s <= record.fault_end_s]
    moving = [s for s in during if not s.is_zero]
    figures = {}
    for key, found in (('last_setpoint_s', during), ('last_motion_s', moving)):
        if found:
            figures[key] = round(found[-1].at_s, 3)
    ended = [each.at_s for each in record.ended if not each.meant]
    if ended:
        figures['ended_s'] = round(ended[0], 3)
    if record.over_person_s is not None:
        figures['over_person_s'] = round(record.over_person_s, 2)
    return figures


def describe(fault: Fault) -> str:
    """Return in words what has to happen."""
    e = fault.expected
    parts = []
    if e.refuses:
        parts.append('the engagement is refused with a sentence')
    if e.reaches:
        parts.append(f'{_names(e.reaches)} within {e.within_s:g} s')
    if e.allowed:
        parts.append(f'nothing but {_names(e.allowed)}')
    if e.still_within_s is not None:
        parts.append(f'no descent after {e.still_within_s:g} s')
    if e.zero_within_s is not None:
        parts.append(f'zero on the wire within {e.zero_within_s:g} s')
    if e.ends_within_s is not None:
        parts.append(f'{" and ".join(e.ends_processes)} ends within {e.ends_within_s:g} s')
    if e.silent_within_s is not None:
        parts.append(f'no set-point after {e.silent_within_s:g} s')
    parts.extend(f'the status says "{words}"' for words in e.says)
    if e.over_person_s is not None:
        parts.append(f'descends over the person for {e.over_person_s:g} s at most')
    if e.recovers:
        parts.append(f'afterwards {_names(e.recovers)} within {e.recovers_within_s:g} s')
    if e.stays:
        parts.append(f'afterwards {e.stays} for good')
    return '; '.join(parts) or 'no unsafe hand-over'


def _names(states: tuple[str, ...]) -> str:
    return ' or '.join(state or 'silence' for state in states)


def _injected(record: Record) -> str:
    if record.trouble:
        return ''
    height = f', {record.altitude_before_m:.1f} m' if isfinite(record.altitude_before_m) else ''
    return f'{record.state_before}{height}, {record.injected_s:.1f} s after the engagement'


def _states(record: Record) -> tuple[str, ...]:
    names: list[str] = []
    for said in record.said:
        if not names or names[-1] != said.state:
            names.append(said.state)
    return tuple(names)


def _happened(record: Record) -> str:
    if record.trouble:
        return record.trouble
    if record.refusal is not None:
        return f'refused: {record.refusal}'
    seen: list[str] = []
    last = record.state_before
    for said in record.said:
        if said.at_s >= 0.0 and said.state != last:
            last = said.state
            seen.append(f'{said.state} after {said.at_s:.1f} s ({said.reason})')
    return '; '.join(seen) or f'{record.state_before} throughout'


def _reaches(expected: Expected, record: Record) -> Iterator[str]:
    wanted = tuple(state for state in expected.reaches if state != ABSENT)
    if not wanted:
        return
    reached = record.first(wanted)
    limit_s = expected.within_s
    if reached is None:
        yield f'{_names(wanted)} never came, {limit_s:g} s allowed'
    elif reached.at_s > limit_s:
        yield f'{reached.state} came after {reached.at_s:.2f} s, {limit_s:g} s allowed'


def _allowed(expected: Expected, record: Record) -> Iterator[str]:
    if not expected.allowed:
        return
    for said in record.said:
        if 0.0 <= said.at_s <= record.fault_end_s and said.state not in expected.allowed:
            yield f'{said.state} after {said.at_s:.2f} s is not allowed: {said.reason}'
            return


def _stands(expected: Expected, record: Record) -> Iterator[str]:
    limit_s = expected.still_within_s
    if limit_s is None:
        return
    gap_s = record.truth_gap_s(limit_s, record.fault_end_s)
    if gap_s > MOST_BLIND_S:
        yield f'after {limit_s:g} s there is no ground truth for {gap_s:.2f} s'
    since_s = record.still_since_s(record.fault_end_s, STANDING_M_S)
    if since_s > limit_s:
        speed = record.fastest_descent_m_s(limit_s, record.fault_end_s)
        yield f'descended until {since_s:.2f} s, {limit_s:g} s allowed, up to {speed:.2f} m/s'


def _zero(expected: Expected, record: Record) -> Iterator[str]:
    limit_s = expected.zero_within_s
    if limit_s is None:
        return
    during = [s for s in record.sent if limit_s <= s.at_s <= record.fault_end_s]
    wrong = [s for s in during if not s.is_zero]
    if wrong:
        yield f'{len(wrong)} set-points after {limit_s:g} s were not zero'


def _silent(expected: Expected, record: Record) -> Iterator[str]:
    limit_s = expected.silent_within_s
    if limit_s is None:
        return
    late = [s for s in record.sent if s.at_s > limit_s]
    if late:
        yield (f'{len(late)} set-points after {limit_s:g} s, the last after {late[-1].at_s:.2f} s')


def _spares(expected: Expected, record: Record) -> Iterator[str]:
    limit_s, over_s = expected.over_person_s, record.over_person_s
    if limit_s is None:
        return
    if over_s is None:
        yield 'no person walked below'
    elif over_s > limit_s:
        yield f'descended over the person for {over_s:.1f} s, {limit_s:g} s allowed'


def _says(expected: Expected, record: Record) -> Iterator[str]:
    reasons = [said.reason for said in record.said if said.at_s >= 0.0]
    for words in expected.says:
        if not any(words in reason for reason in reasons):
            yield f'the status never said "{words}"'


def _recovers(expected: Expected, record: Record) -> Iterator[str]:
    if not expected.recovers:
        return
    if record.ended_s is None:
        yield 'the fault was never taken away'
        return
    again = record.first(expected.recovers, record.ended_s)
    limit_s = expected.recovers_within_s
    if again is None or again.at_s - record.ended_s > limit_s:
        yield f'{_names(expected.recovers)} did not follow within {limit_s:g} s of its end'


def _stays(expected: Expected, record: Record) -> Iterator[str]:
    if not expected.stays:
        return
    begin_s = record.fault_end_s
    again = record.first(expected.recovers, begin_s) if expected.recovers else None
    if again is not None:
        # A restarted node has another state until it is ready.
        begin_s = again.at_s
    after = [s for s in record.said if s.at_s > begin_s + CHANGE_S]
    if not after:
        yield f'{expected.stays} was not said after the fault'
    left = [s.state for s in after if s.state != expected.stays]
    if left:
        yield f'{expected.stays} was left for {left[0]} after the fault'


def _refuses(expected: Expected, record: Record) -> Iterator[str]:
    if expected.refuses and not record.refusal:
        yield 'the engagement was not refused with a sentence'
    if not expected.refuses and record.refusal is not None:
        yield f'the engagement was refused: {record.refusal}'


def _ends(expected: Expected, record: Record) -> Iterator[str]:
    own = {each.name: each for each in record.ended if not each.meant}
    for name in expected.ends_processes:
        if name not in own:
            yield f'{name} did not end'
        elif not own[name].last_words:
            yield f'{name} ended without a word'
        elif expected.ends_within_s is not None and not own[name].status:
            yield f'{name} ended with status 0'
        elif expected.ends_within_s is not None and own[name].at_s > expected.ends_within_s:
            yield (
                f'{name} ended after {own[name].at_s:.2f} s, {expected.ends_within_s:g} s allowed'
            )


def _handovers(_expected: Expected, record: Record) -> Iterator[str]:
    for at_s, why in record.unsafe:
        yield f'unsafe hand-over after {at_s:.1f} s: {why}'


def _crashes(expected: Expected, record: Record) -> Iterator[str]:
    for each in record.ended:
        if not each.meant and each.name not in expected.ends_processes:
            yield (
                f'{each.name} ended by itself with status {each.status} after {each.at_s:.1f} s: '
                f'{each.last_words}'
            )


def _hangs(_expected: Expected, record: Record) -> Iterator[str]:
    if record.refusal is not None:
        return
    begin_s = 0.0
    for at_s in (*(s.at_s for s in record.said if s.at_s >= 0.0), record.closed_s):
        gap_s = at_s - begin_s - _meant_silence_s(record, begin_s, at_s)
        if gap_s > SILENCE_S:
            yield f'the landing node said nothing for {gap_s:.1f} s after {begin_s:.1f} s'
        begin_s = at_s


def _meant_silence_s(record: Record, begin_s: float, end_s: float) -> float:
    spans = ((max(begin_s, a), min(end_s, b)) for a, b in record.stopped_s)
    return sum(max(0.0, b - a) for a, b in spans)


def _floor(expected: Expected, record: Record) -> Iterator[str]:
    if not expected.flies:
        return
    lowest_m = record.lowest_m(record.lost_control_s)
    if lowest_m < FLOOR_M - OVERSHOOT_M:
        yield f'sank to {lowest_m:.2f} m, {OVERSHOOT_M:g} m below the hand-over is allowed'


def _zero_means_zero(_expected: Expected, record: Record) -> Iterator[str]:
    wrong = [
        s
        for s in record.sent
        if not s.is_zero
        and record.state_at(s.at_s - CHANGE_S) in STILL
        and record.state_at(s.at_s) in STILL
        and record.state_at(s.at_s + CHANGE_S) in STILL
    ]
    if wrong:
        first = wrong[0]
        yield (
            f'{len(wrong)} set-points in states that stand still, the first '
            f'{first.v_north_m_s:.2f}, {first.v_east_m_s:.2f}, {first.v_down_m_s:.2f} m/s in '
            f'{record.state_at(first.at_s)} after {first.at_s:.2f} s'
        )


def _nothing_after_abort(_expected: Expected, record: Record) -> Iterator[str]:
    aborted = record.first((State.ABORTED.value,))
    if aborted is None:
        return
    late = [s for s in record.sent if s.at_s > aborted.at_s + CHANGE_S]
    if late:
        yield f'{len(late)} set-points after ABORTED'


_RULES = (
    *(_reaches, _allowed, _stands, _zero, _silent, _says, _spares, _recovers, _stays, _refuses),
    _ends,
)
"""What a fault may ask for."""
_ALWAYS = (_handovers, _crashes, _hangs, _floor, _zero_means_zero, _nothing_after_abort)
"""What holds whatever goes wrong."""
