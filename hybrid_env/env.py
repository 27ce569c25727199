"""The environment of one track: what all environments share, and that with announced switches."""

import functools
import math
import operator
from collections.abc import Mapping
from typing import Any, ClassVar

import gymnasium as gym
import numpy as np

from hybrid_env.checks import (
    BoolArray,
    Float32Array,
    Info,
    OwnState,
    check_choice,
    check_integer,
    checked,
    of_keywords,
)
from hybrid_env.core.kernel import DECIDED
from hybrid_env.core.memory import MEASURED_NAMES
from hybrid_env.options import WorldOptions
from hybrid_env.rendering import METADATA
from hybrid_env.rendering.frame import draw_frame
from hybrid_env.rendering.history import History
from hybrid_env.world import World, stream_state


class TrackEnv(OwnState, gym.Env[Float32Array, np.int64]):
    """An environment of one track; each environment has a subclass that names its options."""

    metadata: ClassVar[Info] = METADATA  # type: ignore[misc]

    options_class: Any
    # Ticks of the running episode; None without a render mode.
    history: History | None = None

    def __init__(self, render_mode: str | None = None, bank_info: bool = False, **options: Any):
        self.render_mode = render_mode
        self.options = of_keywords(self.options_class, options, ["render_mode"])
        rows = 0
        if render_mode is not None:
            check_choice("render_mode", render_mode, ["rgb_array"])
            self.history = History(self.options)
            rows = self.options.longest_step
        self.bank_info = checked("bank_info", bank_info, bool)
        self.world = World(self.options, 1, rows, bank_info=self.bank_info)
        self.action_space = self.world.action_space()
        self.observation_space = self.world.observation_space()  # type: ignore[assignment]

        self._reset_mask = np.ones(1, bool)
        self._started = False
        self._action_count = self.options.action_count
        self._bind_views()

    def action_masks(self) -> BoolArray:
        """Return which actions count now, (actions,), as sb3-contrib's `MaskablePPO` reads them."""
        return self.world.action_mask[0] > 0

    def get_keys_to_action(self) -> dict[tuple[int], int]:
        """Return actions by key for `gymnasium.utils.play`: w straight, a left, d right, s stop,
        each for the first mode of this type.
        """
        by_type = getattr(self.options, "actions", "all") == "types"
        types = [mode.planar.type for mode in self.options.all_modes]
        types = list(self.options.type_names) if by_type else types
        first = int(self.options.switches == "announced")
        last = self.options.action_count - 1
        keys = {"w": "straight", "a": "left", "d": "right", "s": "stop"}
        return {
            (ord(key),): min(first + types.index(of_type), last)
            for key, of_type in keys.items()
            if of_type in types
        }

    def _bind_views(self) -> None:
        """Create views of the single track once, because creating them takes longer than a tick."""
        self._actions = self.world.actions
        self._observation = self.world.observations[0]
        self._reward = self.world.rewards
        self._terminated = self.world.terminated
        block = self.world.blocks[0]
        field = self.options.hypothesis_field
        views = {name: block[name][..., 0] for name in self.world.tick_names}
        views[field] = self.world.bank.hypotheses[field][0, :, 0]
        views |= {name: array[0] for name, array in self.world.drawn.items()}
        views["action_mask"] = self.world.action_mask[0]
        # NumPy scalars, because libraries read the dtype of every value.
        self._info_readers = [
            (name, view.copy if view.ndim else functools.partial(view.__getitem__, ()))
            for name, view in views.items()
        ]
        self._info_names: Info = dict.fromkeys(views)

    def _info(self) -> Info:
        """Return the info of the current tick: NumPy scalars, and copies of arrays."""
        # A dictionary of the final size is filled faster.
        info = self._info_names.copy()
        for name, read in self._info_readers:
            info[name] = read()
        if self.bank_info:
            info |= {name: values[0] for name, values in self.world.bank_tick().items()}
        if math.isnan(info["measurement"].item(0)):
            for name in MEASURED_NAMES:
                info.pop(name, None)
        return info

    def __setstate__(self, state: Info) -> None:
        self.__dict__.update(state)
        # Copied and unpickled views do not share memory with the world.
        self._bind_views()

    def reset(
        self, *, seed: int | None = None, options: Info | None = None
    ) -> tuple[Float32Array, Info]:
        """Begin an episode. Without a seed the random stream continues. `options` is not used."""
        checked("options", options, Mapping | None)
        super().reset(seed=None if seed is None else check_integer("seed", seed, minimum=0))
        if seed is not None or not self.world.seeded[0]:
            self.world.seed(0, stream_state(self.np_random))
        self.world.reset(self._reset_mask)
        self._started = True
        info = self._info()
        if self.history is not None:
            self.history.begin()
            self.history.record(self.world, 0, info, finished=False)
        return self._observation.copy(), info

    def step(self, action: Any) -> tuple[Float32Array, float, bool, bool, Info]:
        """Apply an action of the action space, others raise `InvalidAction`, and advance the
        track.
        """
        try:
            index = operator.index(action)
        except TypeError:
            raise self.world.invalid_action(action) from None
        if not 0 <= index < self._action_count:
            raise self.world.invalid_action(action)
        if not self._started or self._terminated.item(0):
            raise gym.error.ResetNeeded("step() requires a running episode: call reset() first")
        self._actions[0] = index
        events = self.world.step()
        info = self._info()
        if events & DECIDED:
            decisions = self.world.read_decisions()
            del decisions["has_decision"]
            # Flags as arrays without dimensions: Gymnasium's vectorizers would make objects of bool
            # scalars.
            info |= {
                name: values.reshape(()) if values.dtype == np.bool_ else values[0]
                for name, values in decisions.items()
            }
        if self.history is not None:
            self.history.record(self.world, 0, info, self._terminated.item(0))
        return self._observation.copy(), self._reward.item(0), self._terminated.item(0), False, info

    def render(self) -> Any:
        """Return a frame of the episode so far, (height, width, 3) uint8; None without a render
        mode.
        """
        if self.history is None:
            advice = "create the environment with render_mode='rgb_array'"
            gym.logger.warn(f"render() has no effect without a render_mode: {advice}")
            return None
        if not self._started:
            raise gym.error.ResetNeeded("render() requires a running episode: call reset() first")
        return draw_frame(self.history)


class HybridTrackEnv(TrackEnv):
    """Decide quickly and correctly which mode of motion an object has switched to.

    ## Description
    An object moves in a plane along straight lines, left turns and right turns of known radii, with
    process noise on its velocity (the hybrid stochastic model of Golubkov 2018, eq. (1)). Its
    position is measured with noise at every tick. The times at which the mode may switch are known,
    the new mode is unknown. At each switch a bank of Kalman filters, one per hypothesis, starts
    from the current estimate, which is called the anchor (eq. (2)). With `bank="anchor_aware"` the
    bank accounts for the covariance of the anchor; with `bank="published"` it takes the anchor for
    exact. The agent observes how well each hypothesis explains the measurements, and either waits
    for the next measurement or declares a hypothesis.

    With `decide_every=8` a decision is asked for every eight ticks: a wait lasts to the next
    multiple of it in the segment, or to the end of the segment, and the first decision of a segment
    comes at its eighth tick.

    With `evidence` above 0 a declaration counts once a posterior reaches it: that of a mode, or
    where the type is rewarded that of straight, left or right. All hypotheses have equal priors at
    the switch. Before, a declaration waits.

    An episode is one trajectory of several segments. When the agent declares a hypothesis, the
    segment is fast-forwarded: within the same step, the filter of the declared hypothesis runs to
    the end of the segment, and its estimate is the anchor of the next segment. A wrong decision
    therefore also degrades the estimates of the next segment. With `follow="bank"` all filters run
    on, and the next anchor is the mean of their posterior, so that a wrong decision costs its
    reward only.

    ## Action Space
    The action space is `Discrete(M + 1)` for M hypotheses. Hypothesis 0 is straight motion,
    followed by the left turns and then the right turns, in the order of `radii`.

    | Num | Action |
    |---|---|
    | 0 | wait for the next measurement |
    | i + 1 | declare hypothesis i |

    With `actions="types"` the action space is `Discrete(4)`: wait, straight, left, right. The most
    likely hypothesis of the type is declared. An action outside the space raises
    `gymnasium.error.InvalidAction`.

    `action_masks()` and `info["action_mask"]` say which actions count now. Waiting always does; the
    declarations do once there is enough evidence. A declaration under the mask waits, and is no
    error.

    ## Observation Space
    The observation is a float32 `Box` of shape `(6 M + 11,)`: six blocks of M values, one per
    hypothesis, followed by eleven scalars. No quantity has a unit. Each one is multiplied by its
    scale, which Min and Max do not include; `hybrid_env.Layout` reads quantities by name and
    removes the scale. R is the geometric mean of the two measurement variances. "Along" and
    "across" (positive to the left) refer to the heading of the anchor.

    | Num | Name | Observation | Min | Max | Scale |
    |---|---|---|---|---|---|
    | 0 .. M - 1 | log_ratio | log-likelihood since the switch minus the maximum | -30 | 0 | 0.1 |
    | M .. | innovation_along | whitened innovation of the current tick | | | 1 |
    | 2 M .. | innovation_across | whitened innovation, across | | | 1 |
    | 3 M .. | log_variance | log of (innovation variance / R) | 0 | | 1 |
    | 4 M .. | previous | one-hot encoding of the last decided mode | 0 | 1 | 1 |
    | 5 M .. | turn_angle | turn of the heading in a tick, positive to the left [rad] | | | 1 |
    | 6 M | ticks | ticks since the switch, 1 at the first measurement | 1 | | 0.01 |
    | 6 M + 1 | ticks_left | ticks until the next switch | 0 | | 0.01 |
    | 6 M + 2 | log_error_probability | log(1 - maximum posterior), equal priors | -30 | 0 | 0.1 |
    | 6 M + 3 | speed | way of the anchor in a tick / sqrt(R) | 0 | | 1 |
    | 6 M + 4 | displacement_along | (measurement - anchor) / sqrt(R) | | | 0.1 |
    | 6 M + 5 | displacement_across | (measurement - anchor) / sqrt(R), across | | | 0.1 |
    | 6 M + 6 | anchor_xx | position variance of the estimate at the switch / R | 0 | | 1 |
    | 6 M + 7 | anchor_xv | its position-velocity covariance / (R / tau) | | | 10 |
    | 6 M + 8 | anchor_vv | its velocity variance / (R / tau^2) | 0 | | 100 |
    | 6 M + 9 | log_noise | log(variance of the measurement / R), not 0 with sensors only | | | 1 |
    | 6 M + 10 | measured | 1 if the tick has a measurement, else 0 | 0 | 1 | 1 |

    With radars that measure the range rate, it adds to the likelihood of a hypothesis after the
    position; innovations and their variance are those of the position.

    A tick may have no measurement (`missed`, or sensors out of range). The filters then only
    predict: all innovations are zero, the ratios do not change, and the displacement is the one
    that the most likely filter predicts. With `decide_every` the innovations are those of the last
    tick before the decision.

    Three twins have the same actions, rewards and episodes, so that their differences are the worth
    of a bank, of a memory, and of what cannot be observed. `observation="raw"` is the measurement
    without the bank (`hybrid_env.RawLayout`): displacement_along, displacement_across, measured,
    ticks, ticks_left, speed, log_noise. `observation="innovations"` has no sums of evidence
    (`hybrid_env.InnovationsLayout`): innovation_along and innovation_across of each hypothesis, the
    one-hot encoding of the last decided mode, ticks, ticks_left, measured.
    `observation="state"` hides nothing (`hybrid_env.StateLayout`): the one-hot encoding of the true
    mode, position and velocity (in sqrt(R) and per tick) of the object along and across, ticks,
    ticks_left, log_noise.

    With modes that climb or descend, see `hybrid_env.modes`, a hypothesis is a pair of modes and
    has a filter of the height besides. The row then ends with innovation_up and log_variance_up of
    each hypothesis, over the standard deviation and the variance of a measured height, and climb,
    the estimated way up in a tick over this deviation; with `observation="raw"` with
    displacement_up, and with `observation="innovations"` with innovation_up.

    ## Rewards
    Every step has the reward `-delay_cost` for each tick since the last wait or the switch: one
    tick, or with `decide_every` up to so many. A step with a decision has an additional reward of
    +1 if the decision is correct and -1 if it is wrong. The return of a segment decided at its k-th
    tick is therefore (+1 or -1) - k * delay_cost. Train with a discount factor of 1: the delay cost
    already penalizes late decisions.

    ## Starting State
    The object starts at the origin with the given `speed` and a uniformly random heading. On each
    axis the error of the first estimate is drawn from N(0, 0.3 R) for position and from N(0, 0.02
    m^2/s^2) for velocity, as after a typical segment (`initial_error`). `reset` returns the
    observation of the first tick of the first segment.

    ## Episode End
    The episode terminates with the decision on the last segment. The observation of this step is
    the one on which the decision was made. Waiting on the last tick of a segment forces a decision
    in that step, for the most likely hypothesis (with `undecided="keep"`: for the last decided
    mode). An episode is truncated only by `max_episode_steps` of `gym.make`, which is 10,000 for
    the ids.

    ## Information
    `info` describes the current tick at every step: `segment`, `tick`, `true_mode`, `truth` [x, vx,
    y, vy], `measurement` [x, y] (left out without one), `anchor` [x, vx, y, vy], `estimate` [x, vx,
    y, vy] of the active filter, which is that of the last decided mode (with `follow="bank"`: the
    mean of the posterior over all filters), and `log_likelihood` (M,) since the switch.
    `action_mask` (actions,) is 1 where an action counts, as int8.

    With `bank_info=True` it also describes every filter, in the axes of the plane: `innovations`
    (M, 2) [m], `innovation_covariances` (M, 2, 2), `estimates` (M, 4) [x, vx, y, vy] and
    `covariances` (M, 4, 4). The innovations are those before the correction, and left out without
    a measurement; estimates and covariances are those after it.

    With modes that climb or descend `info` also has `true_height` [z, vz], the measured `height`,
    and `height_estimate` [z, vz], and with `bank_info=True` `heights` (M, 2) and
    `height_covariances` (M, 2, 2).

    A step with a decision adds `decided_mode`, `decided_true_mode`, `correct` (by the criterion of
    the reward), `type_correct` (straight, left or right), `ticks` (the decision time since the
    switch), `forced`, `decided_length` (of the segment) and `decided_squared_error` (of the
    estimated position, summed over the segment). Units are m, m/s and ticks.

    ## Arguments
    `gym.make` takes `render_mode` ("rgb_array", or "human" for Gymnasium's window), `bank_info` and
    every option of `hybrid_env.WorldOptions`:

    ```python
    gym.make("hybrid_env:HybridTrack-v0", measurement_variance=0.01, scheme="L50r5 S50 R75r5")
    ```

    All ids have ticks of 0.1 s, 2 m/s, Q 0.001, R 0.1 and 6 segments of 50 to 100 ticks. With 21
    hypotheses the type is rewarded, and a tick costs 0.01; with three it costs 0.02.

    | Id | Hypotheses | `bank` | `decide_every` | `actions` | `follow` |
    |---|---|---|---|---|---|
    | HybridTrack-v0 | S, L5, R5 | anchor_aware | 8 | all | declared |
    | HybridTrackBank-v0 | S, L1 .. L10, R1 .. R10 | anchor_aware | 8 | types | bank |
    | HybridTrackRoad-v0 | S, L and R of 2.5, 5, 10 | anchor_aware | 8 | all | declared |
    | HybridTrackPublished-v0 | S, L5, R5 | published | 1 | all | declared |
    | HybridTrackPublishedBank-v0 | S, L1 .. L10, R1 .. R10 | published | 1 | all | declared |

    HybridTrackRaw-v0 is HybridTrack-v0 with `observation="raw"`. In HybridTrackRoad-v0 the object
    moves otherwise than the bank is told: process noise drawn for every episode, other radii, heavy
    tails and an unknown velocity at the start; the type is rewarded.

    ## References
    Golubkov, Tsyganov and Tsyganova 2018 (model, bank, algorithm ATE); Wald 1947 (sequential
    analysis).
    """

    options: WorldOptions
    options_class = WorldOptions
