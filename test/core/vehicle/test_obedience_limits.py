# Copyright 2026 The peace_ros authors
# SPDX-License-Identifier: Apache-2.0
"""When exactly a position is no longer believed, with reports every sixteenth of a second."""

from __future__ import annotations

from collections.abc import Callable
from math import cos, radians, sin
from random import Random

import pytest

from peace_ros.core.vehicle.obedience import ObedienceWatch, ReportedMotion, Vector

STEP_S = 0.0625
Told = Callable[[float], Vector]
Reported = Callable[[float], Vector | None]


def frozen(_at_s: float) -> Vector:
    return (4.0, -3.0, -50.0)


STANDING = ReportedMotion(frozen(0.0), (0.0, 0.0))


def steady(north: float = 0.0, east: float = 0.0, down: float = 0.0) -> Told:
    return lambda _at_s: (north, east, down)


def moving(north: float = 0.0, east: float = 0.0, down: float = 0.0) -> Reported:
    return lambda at_s: (north * at_s, east * at_s, down * at_s)


def rate_of(reported: Reported) -> Reported:
    """Return the velocity of a position."""

    def velocity(at_s: float) -> Vector | None:
        now, then = reported(at_s), reported(at_s + 0.001)
        if now is None or then is None:
            return None
        north, east, down = ((b - a) / 0.001 for a, b in zip(now, then, strict=True))
        return north, east, down

    return velocity


def noticed(
    told: Told,
    reported: Reported = frozen,
    until_s: float = 14.0,
    *,
    watch: ObedienceWatch | None = None,
    boot: Callable[[float], float] | None = None,
    silent: Callable[[float], bool] = lambda _at_s: False,
    velocity: Reported | None = None,
    noise_m: float = 0.0,
) -> tuple[float, str] | None:
    """Return when the position was first doubted, and why.

    Args:
        told: Velocity.
        reported: Position.
        until_s: End.
        watch: One that may have seen something.
        boot: The autopilot's clock.
        silent: When no report comes.
        velocity: Reported one, None: that of the reported position.
        noise_m: Standard deviation, of the position.
    """
    watch, random = watch or ObedienceWatch(), Random(0)
    for step in range(round(until_s / STEP_S) + 1):
        at_s = step * STEP_S
        if silent(at_s):
            continue
        boot_ns = None if boot is None else round(boot(at_s) * 1e9)
        place, going = reported(at_s), (velocity or rate_of(reported))(at_s)
        motion = None
        if place is not None and going is not None:
            north, east = (each + random.gauss(0.0, noise_m) for each in place[:2])
            motion = ReportedMotion((north, east, place[2]), going[:2])
        watch.take(motion, round(at_s * 1e9), boot_ns)
        watch.tell(told(at_s), round(at_s * 1e9))
        if watch.problem:
            return at_s, watch.problem
    return None


@pytest.mark.parametrize(
    ('speed', 'at_s', 'way'),
    [
        (2.0, 2.0, 'sink 3.0 m in 1.5 s and reports 0.0 m'),
        (0.75, 2.0, 'sink 1.1 m in 1.5 s and reports 0.0 m'),
        (0.5, 4.0, 'sink 1.8 m in 3.5 s and reports 0.0 m'),
        (0.3125, 4.0, 'sink 1.1 m in 3.5 s and reports 0.0 m'),
    ],
)
def test_an_altitude_that_stands_still_is_noticed(speed: float, at_s: float, way: str) -> None:
    found = noticed(steady(down=speed))
    assert found is not None
    assert found[0] == at_s
    assert f'told to {way}: its altitude' in found[1]


@pytest.mark.parametrize('speed', [0.25, 0.0, -0.5])
def test_a_way_down_of_less_than_a_metre_proves_nothing(speed: float) -> None:
    assert noticed(steady(down=speed)) is None


@pytest.mark.parametrize(('share', 'believed'), [(0.21, True), (0.19, False), (-1.0, False)])
def test_a_fifth_of_the_way_must_show(share: float, believed: bool) -> None:
    found = noticed(steady(down=2.0), moving(down=2.0 * share))
    assert (found is None) == believed
    if found:
        assert f'reports {3.0 * share:.1f} m' in found[1]


def test_what_is_told_counts_half_a_second_later_and_until_then() -> None:
    begun = noticed(lambda at_s: (0.0, 0.0, 2.0 if at_s >= 5.0 else 0.0))
    assert begun is not None
    assert begun[0] == 6.0625
    assert 'sink 1.1 m in 1.5 s' in begun[1]
    ended = noticed(
        lambda at_s: (0.0, 0.0, 2.0 if at_s < 5.0 else 0.0),
        lambda at_s: (0.0, 0.0, 2.0 * min(at_s, 4.0)),
    )
    assert ended is not None
    # At t, 5.5 - t of the 6.5 - t seconds that were told are shown: a fifth at 5.25 s.
    assert ended[0] == 5.3125


def test_a_bias_explains_a_slow_descent_but_no_altitude_that_froze() -> None:
    told = steady(down=0.4)  # 1.4 m in 3.5 s
    assert noticed(told, lambda at_s: (4.0, -3.0, 0.075 * at_s - 50.0)) is None
    found = noticed(told, lambda _: (4.0, -3.0, -50.0))
    assert found is not None
    assert 'sink 1.4 m in 3.5 s' in found[1]


@pytest.mark.parametrize(('step_m', 'believed'), [(0.01, True), (0.0099, False)])
def test_an_altitude_froze_that_changes_by_less_than_a_centimetre(
    step_m: float, believed: bool
) -> None:
    found = noticed(
        steady(down=0.3125),  # 1.1 m in 3.5 s, which a bias explains
        lambda at_s: (0.0, 0.0, step_m * (round(at_s / STEP_S) % 2)),
        velocity=moving(),
    )
    assert (found is None) == believed


def test_an_altitude_is_frozen_from_the_begin_of_what_is_compared() -> None:
    found = noticed(
        steady(down=0.3125), lambda at_s: (0.0, 0.0, 0.02 if at_s > 0.5 else 0.0), velocity=moving()
    )
    assert found is not None
    assert found[0] == 0.5 + STEP_S + 3.5


@pytest.mark.parametrize(('speed', 'believed'), [(2.31, False), (2.3, True)])
def test_a_bias_explains_less_than_a_third_of_a_metre_per_second(
    speed: float, believed: bool
) -> None:
    """Told to sink 0.33 m/s * 3.5 s within half a second, it sinks and comes up again."""
    watch = ObedienceWatch()
    for step in range(9):
        at_s = 0.5 * step
        sunk_m = 0.5 if 1.5 <= at_s <= 3.5 else 0.0
        watch.take(ReportedMotion((0.0, 0.0, sunk_m), (0.0, 0.0)), round(at_s * 1e9))
        watch.tell((0.0, 0.0, speed if at_s == 1.0 else 0.0), round(at_s * 1e9))
        assert at_s == 4.0 or not watch.problem
    assert (watch.problem == '') == believed
    assert believed or 'sink 1.2 m in 3.5 s and reports 0.0 m' in watch.problem


@pytest.mark.parametrize('days', [0, 100])
def test_what_is_told_between_two_reports_counts_from_then_on(days: int) -> None:
    watch, begin_ns = ObedienceWatch(), days * 86_400 * 1_000_000_000
    watch.take(STANDING, begin_ns)
    watch.tell((0.0, 0.0, 2.0), begin_ns + 300_000_000)
    watch.take(STANDING, begin_ns + 400_000_000)
    assert watch._marks[-1].told_m - watch._marks[0].told_m == pytest.approx(0.2, abs=1e-6)


def test_a_vehicle_that_climbed_has_a_second_more() -> None:
    found = noticed(
        lambda at_s: (0.0, 0.0, -2.0 if at_s < 5.0 else 2.0),
        lambda at_s: (0.0, 0.0, -2.0 * min(at_s, 5.0)),
    )
    assert found is not None
    assert found[0] == 8.0


@pytest.mark.parametrize(
    ('rate', 'way'), [(0.5, 'sink 1.5 m in 1.5 s'), (1.0, 'sink 3.0 m'), (3.0, 'sink 3.0 m')]
)
def test_time_passes_as_slowly_as_the_slower_clock_says(rate: float, way: str) -> None:
    found = noticed(steady(down=2.0), boot=lambda at_s: rate * at_s)
    assert found is not None
    assert found[0] == 2.0
    assert way in found[1]
    assert noticed(steady(down=2.0), boot=lambda at_s: 100.0 - at_s) is None


@pytest.mark.parametrize(
    ('gap', 'at_s'), [((1.0, 1.5), 2.0), ((1.0, 1.5625), 1.5625 + 0.0625 + 2.0)]
)
def test_a_gap_of_more_than_half_a_second_begins_anew(
    gap: tuple[float, float], at_s: float
) -> None:
    found = noticed(steady(down=2.0), silent=lambda now_s: gap[0] < now_s < gap[1])
    assert found is not None
    assert found[0] == at_s


def test_an_unknown_position_begins_anew() -> None:
    found = noticed(steady(down=2.0), lambda at_s: None if at_s == 1.0 else frozen(at_s))
    assert found is not None
    assert found[0] == 1.0625 + 2.0


def test_a_clock_that_goes_back_begins_anew() -> None:
    watch = ObedienceWatch()
    assert noticed(steady(down=2.0), until_s=1.5, watch=watch) is None
    found = noticed(steady(down=2.0), watch=watch)
    assert found is not None
    assert found[0] == 0.0625 + 2.0


def test_the_same_report_again_is_looked_at_once() -> None:
    watch = ObedienceWatch()
    assert noticed(steady(down=2.0), until_s=1.9375, watch=watch) is None
    count = len(watch._marks)
    for _ in range(5):
        watch.take(STANDING, round(1.9375e9))
    assert len(watch._marks) == count


@pytest.mark.parametrize(('jump_m', 'at_s'), [(3.0, 2.0), (3.0625, 1.0625 + 2.0)])
def test_a_jump_begins_anew(jump_m: float, at_s: float) -> None:
    def reported(now_s: float) -> Vector:
        return (4.0 + (jump_m if now_s >= 1.0 else 0.0), -3.0, -50.0)

    found = noticed(steady(down=2.0), reported)
    assert found is not None
    assert found[0] == at_s


@pytest.mark.parametrize('turned', [0.0, 90.0, 200.0])
@pytest.mark.parametrize(('speed', 'at_s'), [(1.0, 1.875), (0.5625, 2.625), (0.0, None)])
def test_a_position_that_stands_still_exactly_is_noticed_after_a_metre(
    speed: float, at_s: float | None, turned: float
) -> None:
    north, east = speed * cos(radians(turned)), speed * sin(radians(turned))
    found = noticed(steady(north, east))
    assert (found is None) == (at_s is None)
    if found:
        assert found[0] == at_s
        assert 'its position stands still' in found[1]
        assert 'not believed' in found[1]


@pytest.mark.parametrize('velocity_too', [True, False])
@pytest.mark.parametrize('turned', [20.0, 70.0, 200.0])
@pytest.mark.parametrize(
    ('gains', 'named'),
    [
        ((0.0, 1.0, 1.0, 0.0), 'swapped'),
        ((-1.0, 0.0, 0.0, -1.0), 'mirrored'),
        ((0.0, -1.0, 1.0, 0.0), 'turned by 90 degrees'),
        ((0.0, 0.0, 0.0, 0.0), 'stands still'),
    ],
)
def test_faulty_axes_are_named(
    gains: tuple[float, float, float, float], named: str, turned: float, velocity_too: bool
) -> None:
    north, east = 2.5 * cos(radians(turned)), 2.5 * sin(radians(turned))
    went = (gains[0] * north + gains[1] * east, gains[2] * north + gains[3] * east)
    begin_s = 3.0

    def told(at_s: float) -> Vector:
        return (north, east, 0.0) if at_s >= begin_s else (0.0, 0.0, 0.0)

    def reported(at_s: float) -> Vector:
        way_s = max(0.0, at_s - begin_s - 0.6)
        return went[0] * way_s, went[1] * way_s, -50.0

    def right(at_s: float) -> Vector:
        way_s = max(0.0, at_s - begin_s - 0.6)
        return north * way_s, east * way_s, -50.0

    velocity = None if velocity_too else rate_of(right)
    found = noticed(told, reported, velocity=velocity, noise_m=0.05)
    assert found is not None
    assert found[0] - begin_s < 2.0
    assert named in found[1]
    assert ('velocity does not follow what was told' in found[1]) == velocity_too
    assert ('position does not follow the reported velocity' in found[1]) != velocity_too
    assert noticed(told, right, noise_m=0.05) is None


@pytest.mark.parametrize(('told_m_s', 'reported_m_s'), [(0.6, 0.6), (0.7, 0.45)])
def test_a_vehicle_that_hardly_moves_for_its_bias_is_believed(
    told_m_s: float, reported_m_s: float
) -> None:
    """Measured, PX4 v1.17-alpha: told 0.7 m/s it reports 0.45 m/s, and stays where it is."""

    def told(at_s: float) -> Vector:
        return (told_m_s if at_s >= 4.0 else 0.0, 0.0, 0.0)

    def velocity(at_s: float) -> Vector:
        return (reported_m_s if at_s >= 4.5 else 0.0, 0.0, 0.0)

    def reported(at_s: float) -> Vector:
        # A bias as large as the speed: it drifts, then stands.
        return (-reported_m_s * min(at_s, 4.5), 0.0, -50.0)

    assert noticed(told, reported, velocity=velocity, noise_m=0.05) is None


@pytest.mark.parametrize('rate', [0.4, 1.0, 2.0])
def test_the_way_is_that_of_the_clock_of_the_autopilot(rate: float) -> None:
    found = noticed(
        lambda _: (3.0, 0.0, 0.0),
        lambda at_s: (3.0 * max(0.0, rate * at_s - 0.6), 0.0, -50.0),
        velocity=lambda at_s: (3.0 if rate * at_s >= 0.6 else 0.0, 0.0, 0.0),
        noise_m=0.05,
        boot=lambda at_s: rate * at_s,
    )
    assert found is None


def test_a_fast_vehicle_that_is_rarely_reported_does_not_stand_still() -> None:
    found = noticed(
        steady(5.0),
        lambda at_s: (5.0 * max(0.0, at_s - 1.0), 0.0, -50.0),
        noise_m=0.05,
        silent=lambda at_s: at_s % 0.4375 != 0.0,
    )
    assert found is None


def test_a_position_that_runs_away_is_noticed() -> None:
    found = noticed(
        lambda at_s: (1.0, 0.0, 0.0),
        lambda at_s: (-0.3 * at_s, -2.5 * at_s, -50.0),
        noise_m=0.05,
    )
    assert found is not None
    assert found[0] < 6.0


def test_marks_are_kept_as_long_as_they_are_compared() -> None:
    watch = ObedienceWatch()
    noticed(steady(), until_s=14.0, watch=watch)
    assert len(watch._marks) == round(5.5 / STEP_S) + 1


def test_what_was_doubted_or_told_is_forgotten_when_asked() -> None:
    watch = ObedienceWatch()
    assert noticed(steady(down=2.0), watch=watch) is not None
    watch.forget()
    assert watch.problem == ''
    for step in range(100):
        watch.take(STANDING, round((20.0 + step * STEP_S) * 1e9))
    assert watch.problem == '', 'nothing was told since'
    watch.tell((0.0, 0.0, 2.0), round((20.0 + 99 * STEP_S) * 1e9))
    for step in range(100, 140):
        watch.take(STANDING, round((20.0 + step * STEP_S) * 1e9))
    assert watch.problem
