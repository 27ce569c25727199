"""
A switching system that is no target
====================================

Which of two oscillators does a sensor see? `A question about MATLAB's trackingIMM
<https://www.mathworks.com/matlabcentral/answers/520549>`_ asks it for a mass on a spring with a damper, M x'' + C x' + K x = F. Here the
system changes between its two sets of parameters, with the mass free in a plane, and the force F along x.
"""

# %%
# The matrices of a tick are those of the differential equation in the matrix exponential: A itself, as in the question, is not the
# transition matrix of a tick.

import numpy as np
from scipy.linalg import expm

from hybrid_env.modes import LinearMode

tau, force = 0.1, 10.0


def oscillator(name, M, K, C):
    """Return the mode of a mass [kg], a stiffness [N/m] and a damping [N s/m], of the state [x, vx, y, vy]."""
    axis = [[0.0, 1.0], [-K / M, -C / M]]
    inputs = np.array([[0.0], [force / M], [0.0], [0.0]])
    # The constant 1 is a fifth state.
    rates = np.block([[np.kron(np.eye(2), axis), inputs], [np.zeros((1, 5))]])
    tick = expm(tau * rates)
    return LinearMode(tick[:4, :4], tick[:4, 4], name=name)


modes = (oscillator("stiff", M=10.0, K=20.0, C=1.0), oscillator("soft", M=14.0, K=15.0, C=1.0))

# %%
# Switches are announced, after 50 to 100 ticks. With two hypotheses ATE is Wald's test itself, here on the bank of its paper; SPRT is
# the same test on the bank that PPO reads.

import gymnasium as gym

from agents import find_decider, train
from baselines.rules.rollout import record_decisions

system = {"modes": modes, "tau": tau, "speed": 1.0, "measurement_variance": 0.01}
policy = train("ppo", **system, steps=100_000)
env = gym.make("hybrid_env:HybridTrack-v0", **system)
options = env.unwrapped.options
results = {}
for name, named in {"PPO": policy, "ATE": "ate", "SPRT": "sprt"}.items():
    decider = find_decider(named, options)
    made = results[name] = record_decisions(decider, episodes=1000, **system | decider.options)
    print(
        f"{name}: {100 * made.correct.mean():.1f} % correct after {made.ticks.mean():.1f} ticks, "
        f"reward {made.reward.mean():.3f}"
    )

# %%
# PPO decides soonest and earns most, with more errors. The question had an IMM, for switches that nobody announces: another
# environment with the same modes. The rule ``threshold`` changes its statement once the IMM gives another mode a probability of 0.8.

from agents import evaluate as measure

right = measure("threshold:0.8", "hybrid_env:HybridTrackQuickest-v0", **system, episodes=300)
print(f"IMM: {100 * right['right'].value:.1f} % of the ticks right, with unknown switches")

# %%
# The first of the episodes with announced switches.

import matplotlib.pyplot as plt

from agents.figures.tracks import draw_timelines
from baselines.scoring.timelines import NO_MODE
from hybrid_env.rendering.evidence import mode_colour

env = gym.make("hybrid_env:HybridTrack-v0", decide_every=1, **system)
_, info = env.reset(seed=0)
terminated, history = False, []
while not terminated:
    history.append(info)
    _, _, terminated, _, info = env.step(0)
true_mode, truth, measured = (
    np.array([tick[name] for tick in history]) for name in ("true_mode", "truth", "measurement")
)

figure, (path, bars) = plt.subplots(
    2, 1, figsize=(9, 6), height_ratios=(2, 1), sharex=True, layout="constrained"
)
colours = [mode_colour(k, options.all_modes) for k in range(options.hypotheses)]
path.plot(measured[:, 0], ".", color="0.6", markersize=3, label="measured")
for k, mode in enumerate(options.all_modes):
    path.plot(np.where(true_mode == k, truth[:, 0], np.nan), color=colours[k], label=mode.name)
path.set(ylabel="x, m")
path.legend(frameon=False, ncols=3)

# A bar is grey while the decider waits, and then has the colour of the mode that it declares.
rows = {"true mode": true_mode}
for name, decided in results.items():
    pieces = zip(decided.length[0], decided.ticks[0], decided.decided_mode[0], strict=True)
    rows[name] = np.concatenate(
        [np.where(np.arange(length) < wait, NO_MODE, mode) for length, wait, mode in pieces]
    )
draw_timelines(bars, np.arange(len(true_mode) + 1), rows, colours, "tick", wrong={})
plt.show()
