"""The environment of one track with unknown switch moments."""

from hybrid_env.env import TrackEnv
from hybrid_env.quickest_options import QuickestOptions


class HybridTrackQuickestEnv(TrackEnv):
    """State the present mode of motion of an object at every tick; nobody announces the switches.

    ## Description
    An object moves in a plane along straight lines, left turns and right turns of known radii, with
    process noise on its velocity (the hybrid stochastic model of Golubkov 2018, eq. (1)). Its
    position is measured with noise at every tick. At unknown moments it switches to one of the
    other modes, all equally likely or by the option `transitions`. At every tick the agent states
    the mode that it believes to be the present one. It should follow a switch quickly, and not
    change its statement to a wrong mode.

    A bank of Kalman filters of coordinated turns, one per hypothesis, runs on over the switches:
    the interacting multiple model algorithm (Blom & Bar-Shalom 1988). It assumes that the mode is a
    Markov chain with transition probabilities 1 - hazard on the diagonal and hazard / (M - 1)
    elsewhere; the rows of this matrix sum to 1. A statement never changes the object, the
    measurements or the bank. With the same seed, every agent therefore observes the same rows,
    except for its own statements in them.

    ## Action Space
    The action space is `Discrete(M)` for M hypotheses: action i states hypothesis i. Hypothesis 0
    is straight motion, followed by the left turns and then the right turns, in the order of
    `radii`. An action outside the space raises `gymnasium.error.InvalidAction`.

    ## Observation Space
    The observation is a float32 `Box` of shape `(6 M + 3,)`: six blocks of M values, one per
    hypothesis, followed by three scalars. Each quantity is multiplied by its scale, which Min and
    Max do not include; `hybrid_env.QuickestLayout` reads quantities by name and removes the scale.
    R is the geometric mean of the two measurement variances. "Along" and "across" (positive to the
    left) refer to the heading of the merged estimate of the bank.

    | Num | Name | Observation | Min | Max | Scale |
    |---|---|---|---|---|---|
    | 0 .. M - 1 | log_probability | log of the probability of the mode | -30 | 0 | 0.1 |
    | M .. | log_ratio | log-likelihood of the current tick minus the maximum | -30 | 0 | 1 |
    | 2 M .. | innovation_along | whitened innovation of the current tick | | | 1 |
    | 3 M .. | innovation_across | whitened innovation, across | | | 1 |
    | 4 M .. | log_variance | log of (innovation variance / R) | 0 | | 1 |
    | 5 M .. | stated | one-hot encoding of the last statement, at first 0 | 0 | 1 | 1 |
    | 6 M | speed | way of the merged estimate in a tick / sqrt(R) | 0 | | 1 |
    | 6 M + 1 | stated_ticks | number of consecutive statements of this mode | 0 | | 0.01 |
    | 6 M + 2 | measured | 1 if the tick has a measurement, else 0 | 0 | 1 | 1 |

    With radars that measure the range rate, it adds to the likelihood of a hypothesis after the
    position; innovations and their variance are those of the position.

    Modes that climb or descend add to row and `info` what they do in `HybridTrackEnv`.

    A tick may have no measurement (`missed`, or sensors out of range). The filters then only
    predict: all innovations are zero, and the probabilities follow the Markov chain.

    ## Rewards
    A statement of the right mode has a reward of 1, a statement of a wrong mode one of 0. A change
    of the statement to a wrong mode costs `change_cost` in addition; the first statement of an
    episode is no change. A statement changes later rewards only through the cost of the next
    change: a discount factor of 0.95, an average over 20 ticks, is enough for training.

    ## Starting State
    The object starts at the origin with the given `speed` and a uniformly random heading, in a
    random mode. The episode begins at a switch, and the bank knows the first mode. With
    `start="random"` it begins at a random moment of a long trajectory, where r ticks of the segment
    remain with probability P(duration >= r) / E[duration], and all modes are equally probable for
    the bank. On each axis the error of the first estimate is drawn from N(0, 0.3 R) for position
    and from N(0, 0.02 m^2/s^2) for velocity (`initial_error`). `reset` returns the observation of
    the first tick.

    ## Episode End
    The episode terminates with the statement on its last tick, number `ticks`. The observation of
    this step is the one on which the statement was made. An episode is truncated only by
    `max_episode_steps` of `gym.make`, which is 10,000 for the ids.

    ## Information
    `info` describes the current tick at every step: `segment` (number of switches so far), `tick`
    (since the switch or the beginning of the episode, at first 1), `true_mode`, `truth` [x, vx, y,
    vy], `measurement` [x, y] (left out without one), `estimate` [x, vx, y, vy] (the mean over the
    bank), `log_probability` (M,), and `action_mask` (M,), which is 1 everywhere. Units are m, m/s
    and ticks. With `durations="drawn"` also `law` (2, 2, 3), for straight motion and turns, of two
    equally likely humps the offset, span and geometric mean of `hybrid_env.core.habits`; with
    `transitions="drawn"` also `transitions` (M, M), the probabilities of the next mode.

    ## Arguments
    `gym.make` takes `render_mode` ("rgb_array", or "human" for Gymnasium's window) and every option
    of `hybrid_env.QuickestOptions`:

    ```python
    gym.make("hybrid_env:HybridTrackQuickest-v0", tau=0.5, durations="uniform 50-100")
    ```

    | Id | Hypotheses | Defaults |
    |---|---|---|
    | HybridTrackQuickest-v0 | S, L5, R5 | 0.1 s, 2 m/s, Q 0.001, R 0.1, 600 ticks |
    | HybridTrackQuickestBank-v0 | S, L1 .. L10, R1 .. R10 | the same; the radius counts too |
    | HybridTrackQuickestRoad-v0 | S, L5, R5 | the object moves otherwise than the bank is told |

    ## References
    Golubkov, Tsyganov and Tsyganova 2018 (model); Blom and Bar-Shalom 1988 (bank); Page 1954 and
    Shiryaev 1963 (quickest detection of a change).
    """

    options: QuickestOptions
    options_class = QuickestOptions
