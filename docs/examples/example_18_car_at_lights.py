"""
A car that stops at lights
==========================

A car drives on, brakes, stands, speeds up, and turns. The option ``modes`` names its modes of motion; environment, filters, rules and
training follow it.
"""

# %%
# A position is measured ten times a second, with a standard deviation of 1 m. PPO trains on random orders of the modes, so that it
# cannot learn a route by heart. It reads the posterior of each mode and the time.

from agents import train

modes = "straight, accelerate -2, stop, accelerate 2, left 12, right 12"
car = {"modes": modes, "speed": 12.0, "measurement_variance": 1.0, "process_variance": 0.01}
random = car | {"scheme": "random 6x40-70"}
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
# A drive through a town, always on the same route. The speed in ``stop`` is that with which the car moves on. PPO has not seen the
# route: it decides sooner than both tests, and errs more often.

route = (
    "40 straight, 50 accelerate -2, 50 stop, 50 accelerate 2, 40 straight,"
    " 40 accelerate -2, 47 left 12, 40 accelerate 2, 40 straight"
)
drive = car | {"scheme": route, "heading": 0.0}
results = compare(**drive)

# %%
# The first of these drives. Decisions do not change what the car does, so that it can be followed with action 0, which waits.

import matplotlib.pyplot as plt
import numpy as np

from agents.figures.tracks import draw_timelines
from baselines.scoring.timelines import NO_MODE
from hybrid_env.rendering.evidence import mode_colour

env = gym.make("hybrid_env:HybridTrack-v0", decide_every=1, **drive)
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
    2, 1, figsize=(9, 7), height_ratios=(2, 1), layout="constrained"
)
colours = [mode_colour(k, options.all_modes) for k in range(options.hypotheses)]
plane.plot(*measured.T, ".", color="0.6", markersize=3, label="measured")
for k, mode in enumerate(options.all_modes):
    plane.plot(*truth[true_mode == k][:, [0, 2]].T, ".", color=colours[k], label=mode.name)
plane.set(xlabel="x, m", ylabel="y, m", aspect="equal")
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
