"""Time limits: one clock, the nearer of two limits, raised once, and what is refused."""

from __future__ import annotations

import math
import threading

import pytest

from suboctave import interruption
from suboctave.errors import InputError, TimeLimitError
from suboctave.interruption import (
    Interruption,
    TimeLimitReached,
    check_time,
    limited,
    pass_on,
    time_limit,
    time_to_wait,
)


@pytest.fixture
def clock(monkeypatch):
    """A clock that is set by hand."""

    class Clock:
        now = 100.0

    monkeypatch.setattr(interruption, "monotonic", lambda: Clock.now)
    return Clock


def test_the_limit_is_raised_once_as_ctrl_c_is(clock):
    with time_limit(2.0) as limit:
        check_time()
        clock.now += 1.999
        check_time()
        clock.now += 0.001
        with pytest.raises(TimeLimitReached) as reached:
            check_time()
        check_time()  # what finishes a result is not stopped again
        assert limit.reached
    assert isinstance(reached.value, KeyboardInterrupt)
    assert Interruption.of(reached.value) == Interruption(2.0)
    check_time()


def test_nobody_waits_beyond_a_limit(clock):
    assert time_to_wait(0.2) == 0.2
    with time_limit(2.0):
        assert time_to_wait(0.2) == 0.2
        clock.now += 1.95
        assert time_to_wait(0.2) == pytest.approx(0.05)
        clock.now += 0.1
        assert time_to_wait(0.2) == 0.0
        with pytest.raises(TimeLimitReached):
            check_time()
        assert time_to_wait(0.2) == 0.2  # what finishes a result is not hurried


def test_of_two_limits_the_nearer_one_counts(clock):
    with time_limit(10.0) as outer:
        with time_limit(20.0) as inner:
            assert inner is None
            clock.now += 10.0
            with pytest.raises(TimeLimitReached, match="10 s"):
                check_time()
        assert outer.reached
    with time_limit(10.0) as outer:
        with time_limit(1.0) as inner:
            clock.now += 1.0
            with pytest.raises(TimeLimitReached, match="of 1 s"):
                check_time()
        assert inner.reached
        check_time()  # the outer one goes on
        clock.now += 9.0
        with pytest.raises(TimeLimitReached, match="10 s"):
            check_time()


def test_an_outer_limit_passes_through_and_an_own_one_is_an_error_without_a_result(clock):
    @limited
    def verb(*, seconds=None):
        clock.now += 5.0
        check_time()

    with time_limit(3.0), pytest.raises(TimeLimitReached):
        verb(seconds=60.0)
    with pytest.raises(TimeLimitError, match=r"time limit of 3 s.*more seconds="):
        verb(seconds=3.0)
    verb(seconds=6.0)
    verb()


def test_a_limit_belongs_to_its_thread(clock):
    free = []

    def other():
        check_time()
        free.append(True)

    with time_limit(1.0):
        clock.now += 2.0
        thread = threading.Thread(target=other)
        thread.start()
        thread.join()
        with pytest.raises(TimeLimitReached):
            check_time()
    assert free == [True]


@pytest.mark.parametrize("wrong", [0, 0.0, -1.0, math.nan, math.inf, "60", b"1", True, [1.0], 10**400, 1j], ids=repr)
def test_no_positive_number_is_no_limit(wrong):
    with pytest.raises(InputError, match="seconds must be a positive number"), time_limit(wrong):
        pass


def test_whoever_needs_an_interrupted_result_is_interrupted_the_same_way():
    pass_on(None)
    with pytest.raises(TimeLimitReached, match="30 s"):
        pass_on(Interruption(30.0))
    with pytest.raises(KeyboardInterrupt) as raised:
        pass_on(Interruption())
    assert not isinstance(raised.value, TimeLimitReached)
