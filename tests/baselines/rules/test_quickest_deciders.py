"""Classical rules for unknown switch moments agree with literal loops over the ticks of single
tracks.
"""

import math
from types import SimpleNamespace

import numpy as np
import pytest
from recorded_rollouts import recorded

from baselines.rules.change_detection import CusumDecider, ShiryaevRobertsDecider
from baselines.rules.steady import SteadyDecider
from hybrid_env import HybridTrackQuickestVectorEnv, QuickestLayout

OPTIONS = {"ticks": 150, "durations": "uniform 15-40", "measurement_variance": 0.05}
TRACKS = 12


def run(decider, episodes=1):
    """Return rows (T, N, width) and statements (T, N) of a decider that keeps its state."""
    env = HybridTrackQuickestVectorEnv(TRACKS, autoreset_mode="SameStep", **OPTIONS)
    return recorded(env, decider, 150 * episodes)[:2]


def cusum(ratios):
    best = 0.0
    for value in ratios:
        best = max(0.0, best + value)
    return best


def shiryaev_roberts(ratios):
    total = 0.0
    for value in ratios:
        total = (1.0 + total) * math.exp(value)
    return math.log(total)


@pytest.mark.parametrize(
    ("decider", "statistic"),
    [(CusumDecider(2.5), cusum), (ShiryaevRobertsDecider(4.0), shiryaev_roberts)],
)
def test_statements_equal_those_of_a_literal_loop(decider, statistic):
    rows, stated = run(decider, episodes=2)
    layout = QuickestLayout(3)
    ratio, probability = (layout.read(rows, name) for name in ("log_ratio", "log_probability"))
    changes = 0
    for i in range(TRACKS):
        for begin in (0, 150):
            mode = int(probability[begin, i].argmax())
            since = begin
            assert stated[begin, i] == mode
            for k in range(begin + 1, begin + 150):
                values = [
                    -math.inf
                    if other == mode
                    else statistic(
                        list(ratio[since + 1 : k + 1, i, other] - ratio[since + 1 : k + 1, i, mode])
                    )
                    for other in range(3)
                ]
                best = int(np.argmax(values))
                assert abs(max(values) - decider.threshold) > 1e-9
                if values[best] >= decider.threshold:
                    mode = best
                    since = k
                    changes += 1
                assert stated[k, i] == mode

    assert changes > 50


@pytest.mark.parametrize("types", [(0, 1, 2), (0, 1, 1)])
@pytest.mark.parametrize("threshold", [0.4, 0.95])
def test_steady_statements_are_those_of_a_literal_loop_and_last(threshold, types):
    """The turns of the bank, to the left and to the right, are of one type only here."""
    options = SimpleNamespace(types=np.array(types), hypotheses=3)
    rows, stated = run(SteadyDecider.create(options, threshold=threshold), episodes=2)
    probabilities = np.exp(QuickestLayout(3).read(rows, "log_probability"))
    slow = held = 0
    for i in range(TRACKS):
        for begin in (0, 150):
            mode = since = -1
            # What leads, and whether it is likelier than all others together.
            leaders = []
            for k in range(begin, begin + 150):
                p = probabilities[k, i]
                of_type = [p[np.equal(types, kind)].sum() for kind in types]
                best = int(np.argmax(0.8 * np.array(of_type) + 0.2 * p))
                another = mode < 0 or types[best] != types[mode]
                largest = of_type[best] if another else p[best]
                leaders.append((another, types[best] if another else best, largest > 0.5))
                led = len(leaders) >= 5 and len({*leaders[-5:]}) == 1 and largest > 0.5
                sure = largest >= threshold
                if mode < 0:
                    mode, since, leaders = best, k, []
                elif best != mode and (sure or led):
                    held += k - since < 3
                    if k - since >= 3:
                        slow += not sure
                        mode, since = best, k
                assert stated[k, i] == mode

    assert (held if threshold < 0.5 else slow) > 5
