"""The environment of one track."""

import operator
from typing import Any, ClassVar

import gymnasium as gym
import numpy as np
from numpy.typing import NDArray

from hybrid_env.checks import check_choice
from hybrid_env.core.kernel import DECIDED
from hybrid_env.options import WorldOptions
from hybrid_env.rendering.figure import RENDER_FPS, Renderer
from hybrid_env.rendering.history import EpisodeHistory
from hybrid_env.world import World


class HybridTrackEnv(gym.Env[NDArray[np.float32], np.int64]):
    """Decide soon and rightly which mode of motion an object has switched to.

    ## Description
    An object moves on a plane: straight pieces, left turns and right turns on known radii, with noise on its
    velocity (the hybrid stochastic model of Golubkov 2018, eq. (1)). Every tick its position is measured with
    noise. The moments at which it may switch are known, the new mode is not. A bank of Kalman filters, one
    per hypothesis, starts at each switch from the current estimate and is compared with the measurements
    (eq. (2)); with `bank="anchor_aware"` they know how uncertain that estimate is. The agent reads how well
    each hypothesis explains the measurements, and waits or declares one.

    An episode is one trajectory of several segments. A declaration ends the segment for the agent: the chosen
    filter follows the object alone to the segment's end within the same step, and its estimate is where the
    next segment's bank starts. So a wrong decision spoils the next segment too.

    ## Action Space
    `Discrete(M + 1)` for M hypotheses: 0 straight, then left, then right turns, in the order of `radii`.

    | Num | Action |
    |---|---|
    | 0 | wait for the next measurement |
    | i + 1 | declare hypothesis i |

    With `actions="best"` the space is `Discrete(2)`: wait, or declare the likeliest hypothesis. Any other
    action raises `gymnasium.error.InvalidAction`.

    ## Observation Space
    A float32 `Box` of 6 M + 10 numbers: six blocks of M, then ten single ones. `hybrid_env.Layout` reads them
    by name and undoes the scale. R stands for the geometric mean of the two measurement variances; "along"
    and "across" (to the left) are seen in the heading of the estimate at the switch, the anchor.

    | Num | Name | Observation | Min | Max | Scale |
    |---|---|---|---|---|---|
    | 0 .. M - 1 | log_ratio | log-likelihood since the switch less the largest | -30 | 0 | 0.1 |
    | M .. | innovation_along | whitened innovation of the last tick | | | 1 |
    | 2 M .. | innovation_across | the same, across | | | 1 |
    | 3 M .. | log_variance | log of the innovation variance over R | 0 | | 1 |
    | 4 M .. | previous | 1 for the mode decided last | 0 | 1 | 1 |
    | 5 M .. | curvature | signed, left is positive [1/m] | | | 1 |
    | 6 M | ticks | since the switch, 1 at the first measurement | 1 | | 0.01 |
    | 6 M + 1 | ticks_left | to the next switch | 0 | | 0.01 |
    | 6 M + 2 | log_error_probability | log(1 - largest posterior), equal priors | -30 | 0 | 0.1 |
    | 6 M + 3 | speed | of the anchor [m/s] | 0 | | 1 |
    | 6 M + 4 | displacement_along | measurement less anchor, over sqrt(R) | | | 0.1 |
    | 6 M + 5 | displacement_across | the same, across | | | 0.1 |
    | 6 M + 6 | anchor_xx | position variance of the kept estimate, over R | 0 | | 1 |
    | 6 M + 7 | anchor_xv | its covariance of position and velocity, over R [1/s] | | | 1 |
    | 6 M + 8 | anchor_vv | its velocity variance, over R [1/s^2] | 0 | | 1 |
    | 6 M + 9 | log_noise | log R, R in m^2 | | | 1 |

    ## Rewards
    Every step costs `delay_cost`. A decision adds +1 if it is right and -1 if it is wrong, so a segment
    decided at its k-th tick earns (+1 or -1) - k delay_cost. Train with gamma = 1: haste is priced already.

    ## Starting State
    The object starts at the origin with `speed` and a random heading. The first estimate is off by
    N(0, 0.3 R) in position and N(0, 0.02 m^2/s^2) in velocity, as after a typical segment (`initial_error`).
    `reset` returns the first tick of the first segment.

    ## Episode End
    The episode terminates with the decision on the last segment; the row returned then is the one on which
    that decision was made. Waiting on the last tick of a segment decides it in that same step, for the
    likeliest hypothesis (`undecided="keep"`: for the mode decided last). There is no truncation.

    ## Information
    Of the present tick, at every step: `segment`, `tick`, `true_mode`, `truth` [x, vx, y, vy], `measurement`
    [x, y], `anchor`, `estimate` (of the active filter, the mode decided last) and `log_likelihood` (M,) since
    the switch. Of a decision made in this step: `decided_mode`, `decided_true_mode`, `correct` (as rewarded),
    `type_correct`, `ticks`, `forced`, `decided_length` and `decided_squared_error` (of position, summed over
    the segment). In m, m/s and ticks.

    ## Arguments
    Every option of `hybrid_env.WorldOptions` is a keyword of `gym.make`, and `render_mode`:

    ```python
    gym.make("hybrid_env:HybridTrack-v0", measurement_variance=0.01, scheme="L50r5 S50 R75r5")
    ```

    | Id | Hypotheses | Defaults |
    |---|---|---|
    | HybridTrack-v0 | S, L5, R5 | 0.1 s, 2 m/s, Q 0.001, R 0.1, 6 segments of 50 to 100 ticks, cost 0.02 |
    | HybridTrackBank-v0 | S, L1 .. L10, R1 .. R10 | the same, type correctness, cost 0.01 |

    Which policy is good depends on these options, so say them with every figure.

    ## References
    Golubkov, Tsyganov and Tsyganova 2018 (model, bank, ATE); Wald 1947 (sequential tests).

    ## Version History
    * v0: first version
    """

    metadata: ClassVar[dict[str, Any]] = {"render_modes": ["human", "rgb_array"], "render_fps": RENDER_FPS}  # type: ignore[misc]

    def __init__(self, render_mode: str | None = None, **options: Any):
        if render_mode is not None:
            check_choice("render_mode", render_mode, self.metadata["render_modes"])
        self.render_mode = render_mode
        self.options = WorldOptions.of(**options)
        self.history: EpisodeHistory | None = None
        self.renderer: Renderer | None = None
        rendered = render_mode is not None
        self.world = World(self.options, 1, trace_rows=self.options.longest_segment + 1 if rendered else 0)
        if rendered:
            self.history = EpisodeHistory(self.options)
            self.renderer = Renderer(self.options, human=render_mode == "human")
        self.action_space = self.world.action_space()
        self.observation_space = self.world.observation_space()  # type: ignore[assignment]

        self._all = np.ones(1, np.bool_)
        self._action_count = self.options.action_count
        self._started = False
        self._bind_views()

    def _bind_views(self) -> None:
        """Live views of the one track, so that a step makes no new ones."""
        block = self.world.blocks[0]
        self._actions = self.world.actions
        self._observation = self.world.observations[0]
        self._log_likelihood = self.world.bank.hypotheses["log_likelihood"][0, :, 0]
        self._reward, self._terminated = self.world.rewards, self.world.terminated
        self._segment, self._tick, self._true_mode = block["segment"], block["tick"], block["true_mode"]
        self._truth, self._measurement = block["truth"][:, 0], block["measurement"][:, 0]
        self._anchor, self._estimate = block["anchor"][:, 0], block["estimate"][:, 0]

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state)
        self._bind_views()  # copied and unpickled views are arrays of their own

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[NDArray[np.float32], dict[str, Any]]:
        """Begin an episode. Without a seed the track's random stream goes on; `options` is not used."""
        super().reset(seed=seed)
        if seed is not None or not self.world.seeded[0]:
            self.world.seed(0, self.np_random)
        self.world.reset(self._all)
        self._started = True
        info = self._info()
        if self.history is not None:
            self.history.begin(self.world.traced(0), info)
            if self.render_mode == "human":
                self.render()
        return self._observation.copy(), info

    def step(self, action: Any) -> tuple[NDArray[np.float32], float, bool, bool, dict[str, Any]]:
        """Wait one tick (0), or declare a hypothesis and go to the first tick of the next segment."""
        try:
            index = operator.index(action)
        except TypeError:
            raise self.world.invalid_action(action) from None
        if not 0 <= index < self._action_count:
            raise self.world.invalid_action(action)
        if not self._started or self._terminated.item(0):
            raise gym.error.ResetNeeded("step() needs reset() first: no episode is running")
        self._actions[0] = index
        events = self.world.step()
        info = self._info()
        if events & DECIDED:
            info |= {key: values.item() for key, values in self.world.read_decisions().items()}
            del info["has_decision"]
        if self.history is not None:
            self.history.add(self.world.traced(0), info)
            if self.render_mode == "human":
                self.render()
        return self._observation.copy(), self._reward.item(0), self._terminated.item(0), False, info

    def _info(self) -> dict[str, Any]:
        return {
            "segment": self._segment.item(0),
            "tick": self._tick.item(0),
            "true_mode": self._true_mode.item(0),
            "truth": self._truth.copy(),
            "measurement": self._measurement.copy(),
            "anchor": self._anchor.copy(),
            "estimate": self._estimate.copy(),
            "log_likelihood": self._log_likelihood.copy(),
        }

    def render(self) -> Any:
        """A frame of the episode so far: (height, width, 3) uint8 for "rgb_array", a window for "human"."""
        if self.history is None or self.renderer is None:
            gym.logger.warn(
                "render() without a render_mode: make the environment with render_mode='rgb_array' or 'human'"
            )
            return None
        if not self._started:
            raise gym.error.ResetNeeded("render() needs reset() first: no episode is running")
        return self.renderer.draw(self.history)

    def close(self) -> None:
        """Close the window, if there is one."""
        if self.renderer is not None:
            self.renderer.close()
