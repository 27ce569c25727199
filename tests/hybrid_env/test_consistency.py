"""Filters of the true mode are consistent wherever their model is exact.

Then whitened innovations are independent standard normals, the normalized innovation squared (NIS)
has a chi-square distribution with 2 degrees of freedom, and the normalized estimation error squared
one with
4. The model is exact if

- the anchor is exact, as in the oracle bank, or in the first segment with `initial_error=0`: centre
  and rate of a turn are those of the object,
- the object moves straight and the covariance of the anchor is the true one: the model is linear.

The anchor-aware bank is exact to first order in the relative error of the anchor's velocity, here
0.5 %, and filters of radars to first order in the errors of what these measure: the mean of their
innovations is 0.002 and 0.004 here, which 200,000 tracks tell from 0.
"""

import numpy as np
import pytest
from matrix_filters import FIVE_SIGMA, inside, normalized_squares
from own_modes import SCALES, Halt, every_mode
from scipy import stats

from hybrid_env import HybridTrackVectorEnv
from hybrid_env.modes import Climb, parse_modes

TICKS = 60

EXACT_ANCHOR = {"initial_error": 0, "reset_covariance": False}
TRUE_COVARIANCE = {"initial_error": (0.3, 0.02), "reset_covariance": False}
SMALL_ERROR = {"initial_error": (0.3, 1e-4), "bank": "anchor_aware"}
UNEQUAL = {"measurement_variance": (0.02, 0.3), "process_variance": 0.02}
SENSORS = ["1.0", "0.4 period 2", "0.1 period 3"]
WALKER = {
    "speed": 1.4,
    "tau": 1.0,
    "process_variance": 5e-5,
    "sensors": ["radar 0.2 0.01 at 30 9"],
    "measurement_variance": 0.04,
    "initial_error": (1.0, 0.005),
    "reset_covariance": False,
}
AIRCRAFT = {
    "speed": 250.0,
    "tau": 1.0,
    "process_variance": 1.5,
    "radii": (5000.0,),
    "sensors": ["radar 50 0.0035 rate 1 at 50000 15000"],
    "measurement_variance": 2500.0,
    "initial_error": (1.0, 150.0),
    "bank": "anchor_aware",
}
CASES = {
    "oracle, fast turn, unequal noise": {"scheme": "R60r5", "bank": "oracle", "speed": 30.0}
    | UNEQUAL,
    "published, exact anchor, turn, unequal noise": {"scheme": "L60r5"} | EXACT_ANCHOR | UNEQUAL,
    "published, true covariance, straight, unequal noise": {"scheme": "S60"}
    | TRUE_COVARIANCE
    | UNEQUAL,
    "published, fused sensors": {"scheme": "S60", "sensors": SENSORS} | TRUE_COVARIANCE,
    "anchor-aware, straight, unequal noise": {"scheme": "S60", "bank": "anchor_aware"} | UNEQUAL,
    "anchor-aware, exact anchor, turn": {"scheme": "L60r5", "bank": "anchor_aware"} | EXACT_ANCHOR,
    "anchor-aware, small error, fast turn": {"scheme": "R60r5", "speed": 20.0} | SMALL_ERROR,
}
RADARS = {
    "published, radar of a walker": {"scheme": "S60"} | WALKER,
    "anchor-aware, range rates of an aircraft, turn": {"scheme": "L60r5000"} | AIRCRAFT,
}


def run(tracks, seed, **options):
    """Follow one segment. Returns whitened innovations (T, N, 2) and normalized squared errors
    (N,).
    """
    env = HybridTrackVectorEnv(tracks, tick_info=True, bank_info=True, **options)
    _, info = env.reset(seed=seed)
    mode = int(info["true_mode"][0])
    white = np.empty((TICKS, tracks, 2))
    for k in range(TICKS):
        root = np.linalg.cholesky(info["innovation_covariances"][:, mode])
        white[k] = np.linalg.solve(root, info["innovations"][:, mode, :, None])[..., 0]
        last, (*_, info) = info, env.step(np.zeros(tracks, np.int64))
    error = last["estimates"][:, mode] - last["truth"]
    return white, normalized_squares(error, last["covariances"][:, mode])


@pytest.mark.parametrize(
    ("name", "tracks"),
    [
        *((name, 500) for name in CASES | RADARS),
        *(pytest.param(name, 200_000, marks=pytest.mark.study) for name in CASES),
    ],
)
def test_the_filter_of_the_true_mode_is_consistent_where_its_model_is_exact(name, tracks):
    white, error_squared = run(tracks, 2018, **(CASES | RADARS)[name])
    # Tick by tick, in total, and the error at the last tick.
    for k in range(TICKS):
        assert inside((white[k] ** 2).sum(), 2 * tracks), k

    assert inside((white**2).sum(), white.size)
    assert inside(error_squared.sum(), 4 * tracks)
    # Both have the whole distribution, not only the mean.
    assert stats.kstest((white[-1] ** 2).sum(-1), stats.chi2(2).cdf).pvalue > FIVE_SIGMA
    assert stats.kstest(error_squared, stats.chi2(4).cdf).pvalue > FIVE_SIGMA
    # Zero mean, no correlation between the axes and between ticks.
    assert abs(white.mean()) < 5.0 / np.sqrt(white.size)
    assert abs((white[..., 0] * white[..., 1]).mean()) < 5.0 / np.sqrt(white[..., 0].size)
    for lag in (1, 2, 5, 20):
        product = white[lag:] * white[:-lag]
        assert abs(product.mean()) < 5.0 / np.sqrt(product.size), lag


# The anchor of a turn has an error; P := I.
INEXACT = [{"scheme": "L60r5"} | TRUE_COVARIANCE, {"scheme": "S60"}]


@pytest.mark.parametrize("options", INEXACT)
def test_the_same_bounds_are_exceeded_where_the_model_is_not_exact(options):
    white, _ = run(1000, 2018, **options)
    assert not inside((white**2).sum(), white.size)


def squares_of_true_modes(tracks, scale, climbs=False, **options):
    """Return the normalized squared errors of innovations and estimates, {mode: (2, n)}.

    They are those of the filter of the true mode at the 20th tick of every segment: ticks of one
    segment are correlated. Its true mode is declared, so that the next anchor is that of its
    filter. The object never loses its velocity, of which turns and accelerations have their
    heading.
    """
    chosen = SCALES[scale] | options
    modes = tuple(mode for mode in every_mode(scale) if not isinstance(mode, Halt))
    if climbs:
        speed = chosen["speed"]
        modes = parse_modes([*modes[:2], modes[4], Climb(0.1 * speed), Climb(-0.05 * speed)])
        chosen["climb_variance"] = chosen["process_variance"]
        chosen["height_variance"] = chosen["measurement_variance"]
    env = HybridTrackVectorEnv(
        tracks,
        modes=modes,
        tick_info=True,
        bank_info=True,
        bank="anchor_aware",
        scheme="random 3x40",
        initial_error=(0.3, (0.02 * chosen["speed"]) ** 2),
        **chosen,
    )
    squares = {mode: [] for mode in modes}
    _, info = env.reset(seed=1)
    every = np.arange(tracks)
    for tick in range(3 * 20):
        true = info["true_mode"]
        if tick % 20 == 19:
            assert (info["tick"] == 20).all()
            both = [
                normalized_squares(info[name][every, true] - truth, info[spread][every, true])
                for name, spread, truth in (
                    ("innovations", "innovation_covariances", 0.0),
                    ("estimates", "covariances", info["truth"]),
                )
            ]
            if climbs:
                error = info["heights"][every, true] - info["true_height"]
                both[1] += normalized_squares(error, info["height_covariances"][every, true])
            for index, mode in enumerate(modes):
                squares[mode].append(np.array(both)[:, true == index])
        *_, info = env.step(np.where(tick % 20 == 19, true + 1, 0))
    return {mode: np.hstack(parts) for mode, parts in squares.items()}


@pytest.mark.parametrize("climbs", [False, True], ids=["plane", "climbs"])
@pytest.mark.parametrize("scale", SCALES)
@pytest.mark.parametrize(
    "tracks",
    [pytest.param(4_000, id="quick"), pytest.param(50_000, id="study", marks=pytest.mark.study)],
)
def test_the_filter_of_the_true_mode_is_consistent_at_every_scale(tracks, scale, climbs):
    for mode, (innovations, errors) in squares_of_true_modes(tracks, scale, climbs).items():
        assert innovations.size > 0.25 * tracks
        assert inside(innovations.sum(), 2 * innovations.size), (mode, innovations.mean() / 2)
        freedom = 6 if climbs else 4
        assert inside(errors.sum(), freedom * errors.size), (mode, errors.mean() / freedom)


def test_the_same_bounds_are_exceeded_by_an_object_with_more_noise():
    # A mode with noise of its own has it in object and filter.
    larger = 4.0 * SCALES["car"]["process_variance"]
    for mode, (_, errors) in squares_of_true_modes(4_000, "car", object_variance=larger).items():
        assert inside(errors.sum(), 4 * errors.size) == (mode.name in ("drag", "singer")), mode
