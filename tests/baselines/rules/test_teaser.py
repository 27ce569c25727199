"""TEASER: quantiles of right predictions, and predictions in a row."""

import numpy as np

from baselines.rules.posterior_paths import simulate_posterior_paths
from baselines.rules.teaser import TeaserDecider, accepted_errors
from hybrid_env.observation import Layout


def test_the_test_of_a_tick_accepts_95_percent_of_the_right_predictions_of_other_segments():
    limits = accepted_errors(simulate_posterior_paths(400, 0))
    others = simulate_posterior_paths(400, 10**6)
    for tick in (0, 10, 30):
        right = others.correct[:, tick] & (others.length > tick)
        share = (others.log_error_probability[right, tick] <= limits[tick]).mean()
        # Both samples vary.
        assert abs(share - 0.95) < 5.0 * np.sqrt(0.95 * 0.05 / right.sum())

    assert limits[40] < limits[10] < limits[0]


def test_it_declares_after_equal_accepted_predictions_in_a_row_of_one_segment():
    decider = TeaserDecider(np.full(3, np.log(0.3)), 2)
    layout = Layout(3)
    state = None
    found = []
    # Likeliest hypothesis, its error probability and the tick of the segment; the fifth row begins
    # a segment.
    for best, error, tick in (
        (1, 0.2, 1),
        (2, 0.2, 2),
        (2, 0.4, 3),
        (2, 0.2, 4),
        (2, 0.2, 1),
        (2, 0.1, 2),
    ):
        row = np.zeros((1, layout.width), np.float32)
        row[0, layout.slices["log_ratio"]] = np.where(np.arange(3) == best, 0.0, -1.0)
        for name, value in (
            ("log_error_probability", np.log(error)),
            ("ticks", tick),
        ):
            row[0, layout.slices[name]] = value * layout.scales.get(name, 1.0)
        action, state = decider.decide(row, state, None)
        found.append(int(action[0]))

    assert found == [0, 0, 0, 0, 0, 3]
    assert decider.select_tracks(state, np.array([True]))[1].tolist() == [2]
