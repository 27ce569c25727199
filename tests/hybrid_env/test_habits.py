"""Habits: laws of durations and orders of modes, fixed or drawn for every episode."""

import numpy as np

from hybrid_env import HybridTrackQuickestVectorEnv, QuickestOptions
from hybrid_env.durations import ModeDurations, TwoDurations, UniformDurations, parse_durations

DRAWN = {"durations": "drawn", "order": "drawn"}


def timeline(env, ticks, seed):
    """Return modes and segments of all ticks, (T, N), and the first info."""
    _, first = env.reset(seed=seed)
    recorded = [(first["true_mode"], first["segment"])]
    for _ in range(ticks - 1):
        *_, info = env.step(np.zeros(env.num_envs, np.int64))
        recorded.append((info["true_mode"], info["segment"]))
    return *np.moveaxis(np.array(recorded), 1, 0), first


def segments_of(modes, segments):
    """Return the mode, the next mode and the length of all complete segments after the first."""
    complete = []
    for mode, number in zip(modes.T, segments.T, strict=True):
        starts = np.flatnonzero(np.diff(number)) + 1
        complete += zip(
            mode[starts[:-1]],
            mode[starts[1:]],
            np.diff(starts),
            strict=True,
        )
    return np.array(complete)


def test_a_drawn_law_and_order_are_those_of_the_episode():
    tracks = 60
    ticks = 3000
    env = HybridTrackQuickestVectorEnv(
        tracks,
        ticks=ticks,
        tick_info=True,
        **DRAWN,
    )
    modes, segments, info = timeline(env, ticks, 1)

    np.testing.assert_allclose(info["order"].sum(2), 1.0)
    errors = []
    for track in range(tracks):
        switches = segments_of(modes[:, [track]], segments[:, [track]])
        for turns in (0, 1):
            humps = info["law"][track, turns]
            lengths = switches[(switches[:, 0] > 0) == turns, 2]
            if len(lengths):
                assert lengths.min() > humps[:, 0].min()
                if (humps[:, 2] == 1).all():
                    assert lengths.max() <= humps[:, :2].sum(1).max()
            mean = (humps[:, 0] + (humps[:, 1] - 1) / 2 + humps[:, 2]).mean()
            errors += [] if len(lengths) < 5 else [lengths.mean() / mean - 1]
        expected = info["order"][track][switches[:, 0], switches[:, 1]]
        assert (expected > 0).all()
    assert abs(np.mean(errors)) < 0.05
    assert len({str(law) for law in info["law"]}) == tracks


def test_a_fixed_order_and_laws_by_mode_are_followed():
    order = "0 0.9 0.1, 0.2 0 0.8, 1 0 0"
    law = "straight uniform 20-30, turns uniform 5-6 or uniform 9-9"
    env = HybridTrackQuickestVectorEnv(
        200,
        tick_info=True,
        ticks=500,
        durations=law,
        order=order,
    )
    drawn = segments_of(*timeline(env, 500, 2)[:2])
    counts = np.zeros((3, 3))
    np.add.at(counts, (drawn[:, 0], drawn[:, 1]), 1)
    expected = env.options.order_matrix

    np.testing.assert_allclose(
        counts / counts.sum(1, keepdims=True),
        expected,
        atol=0.03,
    )
    assert set(drawn[drawn[:, 0] == 0, 2]) == set(range(20, 31))
    turns = drawn[drawn[:, 0] > 0, 2]
    assert set(turns) == {5, 6, 9}
    assert abs((turns == 9).mean() - 0.5) < 0.03
    assert QuickestOptions(order=expected.tolist()).order == env.options.order


def test_texts_of_laws():
    two = TwoDurations(UniformDurations(30, 40), UniformDurations(80, 90))
    assert parse_durations(" uniform 30-40  or uniform 80-90") == two
    law = ModeDurations(two, UniformDurations(7, 7))
    assert parse_durations(str(law)) == law
    assert str(parse_durations("drawn")) == "drawn"
    assert two.mean_duration == 60
