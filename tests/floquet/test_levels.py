"""What stands in for fast vibrations of a structure, and what it leaves out."""

import numpy as np
import pytest
from many_modes import motion_of, structure

import suboctave as so
from suboctave.floquet import monodromy
from suboctave.floquet.blocks import in_blocks
from suboctave.floquet.left_out import Jumps, _echoes
from suboctave.floquet.levels import levels_of
from suboctave.floquet.monodromy import floquet_multipliers
from suboctave.floquet.symmetric import distinct

KINDS = ("stiffness-proportional", "modal", "full")


def flexibility(motion, first, driven, read, s):
    """G (s - L)^-1 B of blocks, (G, G)."""
    total = np.zeros((driven.shape[1], driven.shape[1]), dtype=complex)
    for b in range(len(motion)):
        a, e = first[b], first[b + 1]
        matrix = motion[b, : e - a, : e - a]
        total += read[0][:, a:e] @ np.linalg.solve(s * np.eye(e - a) - matrix, driven[a:e])
    return total


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("channels", [1, 2])
@pytest.mark.parametrize("order", [0, 1, 2])
def test_substitutes_have_the_flexibility_of_what_they_stand_for(kind, channels, order):
    """At rest, and what differs grows with that power of the frequency that the derivatives leave."""
    system, _ = structure(24, 300.0, channels, kind, 1)
    state = motion_of(system, 9, 1.1, 1)
    levels = levels_of(state.linear, state.balance.all_groups)
    blocks = levels.blocks
    level = levels.of(10, order)
    assert level.states == level.own + 2 * order * channels

    def apart(share):
        s = 1j * share * blocks.rates[10]
        exact = flexibility(blocks.motion, blocks.first, blocks.driven, blocks.read, s)
        own = flexibility(level.motion, level.first, level.driven, level.read, s) + level.flexible
        return np.abs(exact - own).max() / np.abs(exact).max()

    # of the first power by damping, which a spring has none of
    power = 4 * order if order else 1.0
    assert apart(0.01) < 1e-3
    assert apart(0.4) < 0.1
    if order < 2:  # of the eighth power only rounding is left
        assert np.log(apart(0.2) / apart(0.1)) / np.log(2.0) > power - 0.2
    if order:
        assert level.rates[10:].min() >= blocks.rates[10]
        assert level.decays[10:].max() < 0.0


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("channels", [1, 2])
@pytest.mark.parametrize("smooth", [False, True])
def test_stated_errors_cover_what_is_left_out(kind, channels, smooth, monkeypatch):
    """Every multiplier against the one that all vibrations give."""
    element = (lambda d: so.CubicSpring(direction=d, coefficient=0.3)) if smooth else None
    for seed in range(2):
        system, _ = structure(32, 300.0, channels, kind, seed, element)
        state = motion_of(system, 9, 1.1, seed)
        few = monodromy.Linearised(state)
        assert few.size < 2 * system.n
        result = floquet_multipliers(state)
        with monkeypatch.context() as patch:
            patch.setattr(monodromy, "_NEGLECTED", (0.0, 0.0))
            whole = floquet_multipliers(state)
        assert len(result.multipliers) == len(whole.multipliers)
        apart = np.abs(result.multipliers[:, None] - whole.multipliers).min(axis=1)
        alive = np.abs(result.multipliers) > 1e-2
        assert alive.sum() >= 4
        assert np.all(apart[alive] <= result.errors[alive] + whole.errors[alive])
        assert np.all(apart[np.abs(result.multipliers) > 0.5] < 1e-3)


@pytest.mark.parametrize("wait", [0.02, 0.3])
def test_jumps_meet_in_free_vibrations(wait):
    """What two jumps of stiffness make together of all coefficients behind the last one known, summed one by one."""
    rate, last, orders = 1.1, 20.5, np.arange(21, 1201)
    system, _ = structure(24, 300.0, 1, "modal", 1)
    state = motion_of(system, 9, rate, 1)
    levels = levels_of(state.linear, state.balance.all_groups)
    blocks, level = levels.blocks, levels.of(16, 1)
    assert blocks.rates[16] > 1.5 * last * rate

    def missing(s):
        own = flexibility(level.motion, level.first, level.driven, level.read, s) + level.flexible
        return flexibility(blocks.motion, blocks.first, blocks.driven, blocks.read, s)[0, 0] - own[0, 0]

    # coefficients 1 / n, of jumps at 0 and at `wait`: what is left when each alone is taken from both
    both = sum(missing(1j * n * rate).real * 4.0 * np.cos(n * wait) / n**2 for n in orders)
    jumps = Jumps(np.array([0.0, wait]), np.zeros(2, dtype=np.int64))
    # that of two jumps, each of them half of the squares
    echoes = 4.0 * rate * _echoes(level.left_out, rate, last * rate, jumps)[0, 0, 0]
    assert echoes == pytest.approx(abs(both), rel=0.2)


def test_few_states_serve_a_long_chain():
    """As many as its vibrations among the harmonics and some more, at the peak of its resonance too."""
    n = 300
    matrix = 4.0 * n**2 / np.pi**2 * (2.0 * np.eye(n) - np.eye(n, k=1) - np.eye(n, k=-1))
    matrix[-1, -1] /= 2.0
    tip = 2.0 / n
    system = so.System(
        tip * np.eye(n), tip * (0.02 * np.eye(n) + 0.002 * matrix), tip * matrix,
        [so.CubicSpring(n - 1, 0.3)], [so.HarmonicLoad(n - 1, 0.05)],
    )  # fmt: skip
    curve = so.frequency_response(system, (1.2, 1.1), harmonics=15)
    motions = [monodromy.Linearised(point.orbit.state()) for point in curve.points[::8]]
    assert max(motion.size for motion in motions) <= 32
    assert len(in_blocks(motions[0].state.linear, motions[0].state.balance.all_groups).rates) >= 20


def test_multipliers_that_have_decayed_to_nothing_are_no_family():
    assert len(distinct(np.array([0.5, 0.5, 0.0, 0.0 + 0.0j]))) == 3
