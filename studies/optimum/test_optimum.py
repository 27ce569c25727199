"""The exact posteriors beside literal sums and particles, and the bound beside all statements."""

import itertools

import numpy as np
import pandas as pd
import pytest
from scipy.stats import multivariate_normal

from baselines import rollout, smooth_modes
from hybrid_env import HybridTrackQuickestVectorEnv, QuickestOptions, simulate
from studies.optimum.enumeration import history_posteriors, path_posteriors
from studies.optimum.study import KNOWN_START, WORLDS, bound_scores

PATHS = WORLDS["12 ticks without process noise"] | KNOWN_START | {"measurement_variance": 0.1}


def path_of(modes, tau):
    """Return the positions of an object without process noise, (T, 2)."""
    runs = [(mode, len(list(run))) for mode, run in itertools.groupby(modes)]
    scheme = " ".join(f"{'SLR'[mode]}{ticks}{'r5' if mode else ''}" for mode, ticks in runs)
    start = (0.0, 2.0, 0.0, 0.0)
    return simulate(scheme, start=start, tau=tau, process_variance=0.0).truth[0][:, [0, 2]]


def test_the_posterior_is_the_literal_sum_over_all_sequences_of_modes():
    options = QuickestOptions(**PATHS | {"ticks": 4})
    points = path_of((0, 1, 2, 2), options.tau)
    points += np.random.default_rng(1).normal(0.0, 0.3, (4, 2))
    chain = np.array([[10.0, 1.0, 1.0], [1.0, 10.0, 1.0], [1.0, 1.0, 10.0]]) / 12.0
    expected = np.zeros((4, 3))
    for ticks in range(1, 5):
        for modes in itertools.product(range(3), repeat=ticks):
            switches = [chain[pair] for pair in itertools.pairwise(modes)]
            density = multivariate_normal(path_of(modes, options.tau).ravel(), 0.1)
            weight = np.prod(switches) * density.pdf(points[:ticks].ravel())
            expected[ticks - 1, modes[-1]] += weight
    expected /= expected.sum(1, keepdims=True)

    assert 0.4 < expected.max(1).min() < 0.9
    posterior = np.exp(path_posteriors(options, points[None])[0])
    np.testing.assert_allclose(posterior, expected, atol=1e-12)


@pytest.mark.parametrize("heading", [0.0, 2.0])
def test_histories_with_filters_are_the_paths_without_process_noise(heading):
    options = QuickestOptions(**PATHS | {"ticks": 5, "heading": heading, "radii": (3.0, 8.0)})
    points = np.random.default_rng(2).normal(0.5, 0.5, (5, 2)).cumsum(0)
    paths = path_posteriors(options, points[None])[0]

    np.testing.assert_allclose(history_posteriors(options, points, nodes=1), paths, atol=1e-9)


@pytest.mark.parametrize("start", ["known", "random"])
def test_histories_with_process_noise_agree_with_simulated_objects(start):
    """Every object of the environment is weighted by the likelihood of the measurements of one
    more object. The speed at a switch differs by a tenth.
    """
    options = QuickestOptions(
        **PATHS | {"ticks": 6, "process_variance": 0.02, "durations": "uniform 2-4", "start": start}
    )
    batches = [simulated(options, 20_000, seed) for seed in range(0, 200_000, 20_000)]
    positions, modes = (np.concatenate(parts, axis=1) for parts in zip(*batches, strict=True))
    error = np.random.default_rng(6).normal(0.0, np.sqrt(0.1), (6, 2))
    measurements = positions[:, 0] + error
    first = int(modes[0, 0])
    known = modes[0] == first if start == "known" else np.ones(modes.shape[1], bool)
    # The object that is measured does not count.
    known[0] = False
    squares = ((positions[:, known] - measurements[:, None]) ** 2).sum(-1)
    weights = np.exp(-0.5 * squares.cumsum(0) / 0.1)
    posteriors = np.exp(
        history_posteriors(options, measurements, first if start == "known" else None)
    )
    for tick, posterior in enumerate(posteriors):
        share = weights[tick] / weights[tick].sum()
        for mode, probability in enumerate(posterior):
            inside = modes[tick, known] == mode
            mean = share @ inside
            deviation = np.sqrt(share**2 @ (inside - mean) ** 2)
            assert deviation < 0.02
            assert abs(probability - mean) < 4.0 * deviation + 1e-9


def simulated(options, tracks, seed):
    """Return the positions (T, N, 2) and the modes (T, N) of objects of the environment."""
    env = HybridTrackQuickestVectorEnv(
        tracks, autoreset_mode="Disabled", tick_info=False, **vars(options)
    )
    positions = []
    modes = []
    for _ in rollout(env, lambda rows: np.zeros(len(rows), int), seed):
        positions.append(env.world.field("truth")[:, [0, 2]])
        modes.append(env.world.field("true_mode").copy())
        if len(modes) == options.ticks:
            break
    return np.array(positions), np.array(modes)


def test_the_bound_is_the_best_of_all_statements():
    right = np.random.default_rng(5).dirichlet(np.ones(3), (5, 1))
    rewards = []
    for stated in itertools.product(range(3), repeat=5):
        each = [right[tick, 0, mode] for tick, mode in enumerate(stated)]
        changed = np.diff(stated, prepend=stated[0]) != 0
        rewards.append(np.mean(np.array(each) - 0.7 * changed * (1.0 - np.array(each))))

    assert bound_scores(np.log(right), 0.7).values[0, 0, 0] == pytest.approx(max(rewards))


def test_the_quick_form_writes_its_files(tmp_path, quick_study):
    _, content = quick_study("optimum")
    rows = pd.DataFrame(content)
    assert (tmp_path / "optimum.png").exists()
    values = rows.assign(value=[value["value"] for value in rows.value])
    figures = values.pivot(index="figure", columns="decider", values="value").T

    # The expected reward of no decider is larger.
    free, costly = figures["reward, cost 0"].dropna(), figures["reward, cost 5"]
    assert free.idxmax() == "exact posterior"
    assert costly.idxmax() == "upper bound"
    assert costly.drop("upper bound").le(free).all()
    counted = figures.at["exact posterior", "right ticks, counted"]
    assert counted == pytest.approx(free["exact posterior"], abs=0.1)
    assert figures["divergence"].dropna().between(0.0, 1.0).all()


def five_modes(options, points, smoothed=False):
    """Posteriors over histories. Without process noise the speed at a switch is known."""
    return history_posteriors(options, points[0], None, 1, smoothed)


@pytest.mark.parametrize(
    ("changed", "exact", "deviation"),
    [
        ({"ticks": 12, "durations": "geometric 50"}, path_posteriors, 0.1),
        ({"ticks": 12, "durations": "geometric 6"}, path_posteriors, 0.3),
        ({"ticks": 13, "durations": "uniform 4-7", "radii": (2.0, 5.0)}, five_modes, 0.3),
        ({"ticks": 13, "durations": "uniform 4-7", "radii": (2.0, 5.0)}, five_modes, 0.1),
    ],
)
def test_hindsight_is_within_a_thousandth_of_the_posterior_over_all_histories(
    changed, exact, deviation
):
    """In short recordings histories merge only if their last four segments are the same."""
    known = {"tau": 0.5, "process_variance": 0.0, "measurement_variance": deviation**2}
    options = QuickestOptions(**PATHS | known | changed)
    modes = [0] * 4 + [1] * 5 + [0] * (options.ticks - 9)
    path = path_of(modes, options.tau)
    start = np.array([0.0, 2.0, 0.0, 0.0]), np.zeros((4, 4))
    differences = []
    for seed in range(2):
        points = path + np.random.default_rng(seed).normal(0.0, deviation, path.shape)
        causal, expected = (
            np.exp(exact(options, points[None], smoothed=smoothed)).reshape(-1, options.hypotheses)
            for smoothed in (False, True)
        )
        result = smooth_modes(points, options, start)
        differences.append(np.abs(result.probabilities - expected).max())
        assert np.abs(causal - expected).max() > 0.2
    assert max(differences) < 0.001
