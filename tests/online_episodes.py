"""Episodes of the environments, and the on-line tracker on their measurements, compared tick by
tick.
"""

import copy

import numpy as np
from scipy import special

from baselines import OnlineTracker
from hybrid_env import HybridTrackQuickestVectorEnv, HybridTrackVectorEnv
from hybrid_env.core.compilation import compiled
from hybrid_env.core.memory import LANES, PARAMETERS
from hybrid_env.core.true_object import draw_first_estimate
from hybrid_env.live import SQUARE
from hybrid_env.world import World, random_states

SIZES = {
    # R and radii; speed, tick, Q and the error of the first estimate.
    "R 0.1": (0.1,),
    "axes": ((0.05, 0.2), (2.0, 5.0)),
    "walker": (0.04, (1.0, 3.0), 1.4, 0.5, 4e-4, (1.0, 0.01)),
    "car": (1.0, (20.0, 60.0), 15.0, 0.1, 0.01, (1.0, 1.0)),
    "ship": (100.0, (300.0,), 8.0, 5.0, 1e-3, (1.0, 0.1)),
    "aircraft": (2500.0, (5e3, 1.5e4), 250.0, 1.0, 0.5, (1.0, 100.0)),
}
NAMES = ("measurement_variance", "radii", "speed", "tau", "process_variance", "initial_error")
COMMON = {name: dict(zip(NAMES, values, strict=False)) for name, values in SIZES.items()}
"""Options of objects of very different size, and of the environment at several noises."""

# Ticks of a step: a segment of 100 and the first tick of the next.
MOST_ROWS = 101

_draw = compiled(draw_first_estimate)


def first_estimate(options, seed):
    """Return the estimate (4,) before the first tick of an episode, and its covariance (4, 4)."""
    world = World(options, 1)
    parameters = np.zeros(1, PARAMETERS)
    for name, value in options.parameters().items():
        parameters[name] = value
    world.seed(0, random_states([seed])[0])
    block = world.blocks[0]
    _draw(block, np.zeros((5, LANES)), 0, parameters[0])
    return block["estimate"][:, 0].copy(), block["covariance"][:, 0][SQUARE]


def same_as_quickest(decider, seed, ticks=100, **options):
    """Check that the tracker equals `HybridTrackQuickestEnv` in every tick; return the
    statements.
    """
    env = HybridTrackQuickestVectorEnv(1, tick_info=True, ticks=ticks, **options)
    rows, info = env.reset(seed=seed)
    tracker = OnlineTracker(env.options, copy.deepcopy(decider), gate=None)
    tracker.begin(
        *first_estimate(env.options, seed),
        info["true_mode"][0] if env.options.start == "known" else None,
    )
    observe = getattr(decider, "observe", None)
    state = None
    start = np.ones(1, np.bool_)
    modes = []
    decided = False
    for k in range(ticks):
        now = tracker.update(tuple(env.world.field("measurement")[0].tolist()), env.options.tau * k)
        actions, state = decider.predict(
            rows if observe is None else observe(env.world), state, start
        )
        start = np.zeros(1, np.bool_)
        assert tracker.world.observations.tobytes() == rows.tobytes()
        # From then on always.
        decided = decided or now.decided
        changed = bool(modes) and actions[0] != modes[-1]
        assert (now.mode, now.decided) == (
            actions[0],
            decided or changed or env.options.start == "known",
        )
        np.testing.assert_array_equal(now.probabilities, np.exp(info["log_probability"][0]))
        np.testing.assert_array_equal(now.estimate, info["estimate"][0])
        np.testing.assert_array_equal(now.covariance, env.world.field("covariance")[0][SQUARE])
        modes.append(now.mode)
        rows, *_, info = env.step(actions)
    return modes


def same_as_announced(decider, seed, **options):
    """Check that the tracker equals `HybridTrackEnv` in every tick; return the decided modes and
    forced.
    """
    env = HybridTrackVectorEnv(1, tick_info=True, trace_rows=MOST_ROWS, **options)
    rows, info = env.reset(seed=seed)
    world, tau = env.world, env.options.tau
    tracker = OnlineTracker(env.options, copy.deepcopy(decider), gate=None)
    tracker.begin(info["anchor"][0], world.field("covariance")[0][SQUARE])
    tracker.switch(int(world.field("length")[0]))
    state = None
    start = np.ones(1, np.bool_)
    decided = []
    time = 5.0
    truth = []
    while True:
        if len(truth) == 2:
            tracker = copy.copy(tracker)
        now = tracker.update(tuple(env.world.field("measurement")[0].tolist()), time)
        time += tau
        actions, state = decider.predict(rows, state, start)
        start = np.zeros(1, np.bool_)
        assert tracker.world.observations.tobytes() == rows.tobytes()
        np.testing.assert_allclose(
            now.probabilities, special.softmax(info["log_likelihood"][0]), rtol=1e-12
        )
        assert now.decided == bool(actions[0])
        if not now.decided or env.options.follow == "bank":
            np.testing.assert_array_equal(now.estimate, info["estimate"][0])
        truth.append(info["truth"][0, ::2])
        rows, _, terminated, _, info = env.step(actions)
        if not info.get("_decided_mode", [False])[0]:
            continue
        decided.append((int(info["decided_mode"][0]), bool(info["forced"][0])))
        ahead = world.read_trace(0)
        if not terminated[0]:
            # The last row is the first tick of the next segment.
            ahead = ahead[:-1]
        for row in ahead:
            now = tracker.update(tuple(row[4:6].tolist()), time)
            time += tau
            np.testing.assert_array_equal(now.estimate[::2], row[6:8])
            assert now.decided
            assert now.mode == row[8]
        truth = []
        if terminated[0]:
            return decided
        tracker.switch(int(world.field("length")[0]))
        if not info["forced"][0]:
            np.testing.assert_array_equal(now.estimate, info["anchor"][0])
            np.testing.assert_array_equal(now.covariance, world.field("covariance")[0][SQUARE])
