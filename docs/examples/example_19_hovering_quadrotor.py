"""
A quadrotor that hovers and cruises
===================================

A quadrotor hovers, accelerates, brakes, or cruises to the east or to the north. It must tilt before it accelerates, so that a mode has the
acceleration in its state: a ``LinearMode`` of six states.
"""

# %%
# In every mode the autopilot asks for the acceleration u - k v on each axis, and the tilt follows with a lag of 0.3 s. Hover and cruise
# hold a velocity, u / k. The matrix exponential gives the exact motion in a tick.

import numpy as np
from scipy.linalg import expm

from hybrid_env.modes import LinearMode

tau, lag = 0.1, 0.3


def mode(name, k, u):
    """Return a mode of the state [x, vx, ax, y, vy, ay]; k in 1/s, u in m/s^2 to the east and to the north."""
    axis = [[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [0.0, -k / lag, -1.0 / lag]]
    inputs = np.kron(u, [0.0, 0.0, 1.0 / lag])[:, None]
    # The constant 1 is a seventh state.
    rates = np.block([[np.kron(np.eye(2), axis), inputs], [np.zeros((1, 7))]])
    tick = expm(tau * rates)
    return LinearMode(tick[:6, :6], tick[:6, 6], name=name)


modes = (
    mode("hover", 1.0, (0.0, 0.0)),
    mode("accelerate", 0.0, (2.0, 0.0)),
    mode("brake", 0.0, (-2.0, 0.0)),
    mode("cruise east", 1.0, (6.0, 0.0)),
    mode("cruise north", 1.0, (0.0, 6.0)),
)

# %%
# PPO trains on random orders of these modes, and reads the posterior of each mode and the time.

from agents import train

quadrotor = {"modes": modes, "tau": tau, "speed": 0.01, "process_variance": 0.01}
random = quadrotor | {"scheme": "random 6x40-70"}
policy = train("ppo", **random, steps=100_000)

# %%
# All deciders face the same episodes, in random orders first. ATE has the bank of its paper; SPRT is the same test on the bank that
# PPO reads.

import gymnasium as gym

from agents import find_decider
from baselines.rules.rollout import record_decisions


def compare(**world):
    """Let the deciders face the same 1,000 episodes, and return the decisions of each."""
    options = gym.make("hybrid_env:HybridTrack-v0", **world).unwrapped.options
    results = {}
    for name, named in {"PPO": policy, "ATE": "ate", "SPRT": "sprt"}.items():
        decider = find_decider(named, options)
        made = results[name] = record_decisions(decider, episodes=1000, **world | decider.options)
        print(
            f"{name}: {100 * made.correct.mean():.1f} % correct after {made.ticks.mean():.1f} ticks, "
            f"reward {made.reward.mean():.3f}"
        )
    return results


compare(**random)

# %%
# PPO decides soonest, errs least and earns most. It also earns most on one route, which it has not seen:

route = (
    "40 hover, 40 accelerate, 60 cruise east, 60 cruise north, 50 cruise east, 30 brake, 50 hover"
)
flight = quadrotor | {"scheme": route, "heading": 0.0}
results = compare(**flight)

# %%
# The first of these flights. Decisions do not change what the quadrotor does, so that it can be followed with action 0, which waits.

import matplotlib.pyplot as plt

from agents.figures.tracks import draw_timelines
from baselines.scoring.timelines import NO_MODE
from hybrid_env.rendering.evidence import mode_colour

env = gym.make("hybrid_env:HybridTrack-v0", decide_every=1, **flight)
options = env.unwrapped.options
_, info = env.reset(seed=0)
terminated, history = False, []
while not terminated:
    history.append(info)
    _, _, terminated, _, info = env.step(0)
true_mode, truth, measured = (
    np.array([tick[name] for tick in history]) for name in ("true_mode", "truth", "measurement")
)

figure, (plane, bars) = plt.subplots(
    2, 1, figsize=(9, 8), height_ratios=(2, 1), layout="constrained"
)
colours = [mode_colour(k, options.all_modes) for k in range(options.hypotheses)]
plane.plot(*measured.T, ".", color="0.6", markersize=3, label="measured")
for k, mode in enumerate(options.all_modes):
    plane.plot(*truth[true_mode == k][:, [0, 2]].T, ".", color=colours[k], label=mode.name)
plane.set(xlabel="east, m", ylabel="north, m", aspect="equal")
plane.legend(frameon=False)

# A bar is grey while the decider waits, and then has the colour of the mode that it declares.
rows = {"true mode": true_mode}
for name, decided in results.items():
    pieces = zip(decided.length[0], decided.ticks[0], decided.decided_mode[0], strict=True)
    rows[name] = np.concatenate(
        [np.where(np.arange(length) < wait, NO_MODE, mode) for length, wait, mode in pieces]
    )
draw_timelines(bars, np.arange(len(true_mode) + 1), rows, colours, "tick", wrong={})
plt.show()
