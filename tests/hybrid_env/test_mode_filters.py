"""Modes of the user: the banks equal filters in matrix form, and filters are consistent at every
scale.
"""

import numpy as np
import pytest
from matrix_filters import FREEDOM, bank_values, inside, normalized_squares, step_filters
from own_modes import SCALES, Halt, ImmOfModes, described, every_mode, filters_of_modes

from hybrid_env import HybridTrackQuickestVectorEnv, HybridTrackVectorEnv, Radar, Sensor
from hybrid_env.core.memory import LANES

SENSORS = (Sensor(variance=2.0, period=2), Sensor(variance=0.5, position=(9.0, 5.0), range=30.0))
DOPPLER = (
    Radar(range_deviation=1.0, bearing_deviation=0.01, rate_deviation=0.3, position=(0.0, -60.0)),
    Sensor(variance=2.0, velocity_variance=0.04),
)
UNEQUAL = {"measurement_variance": (0.5, 2.0)}
ANNOUNCED = {
    "published": {"reset_covariance": True} | UNEQUAL,
    "published, merged": {"follow": "bank", "reset_covariance": True} | UNEQUAL,
    "published, robust": {"likelihood": f"student_t {FREEDOM}", "missed": 0.3, "noise": "levy 1.4"},
    "aware, missed": {"bank": "anchor_aware", "missed": 0.3} | UNEQUAL,
    "aware, sensors": {"bank": "anchor_aware", "sensors": SENSORS, "missed": 0.2},
    "aware, range rates": {"bank": "anchor_aware", "sensors": DOPPLER},
}


def agree(computed, expected, name):
    """Check that arrays (..., k) agree within 1e-9 of 1, or of the largest of each k numbers if it
    is larger.
    """
    computed, expected = np.array(computed), np.array(expected)
    np.testing.assert_array_equal(np.isnan(computed), np.isnan(expected))
    difference, expected = np.nan_to_num(computed - expected), np.nan_to_num(expected)
    largest = np.abs(expected).max(-1, keepdims=True).clip(min=1.0)
    assert (np.abs(difference) <= 1e-9 * largest).all(), name


@pytest.mark.parametrize("options", ANNOUNCED.values(), ids=ANNOUNCED)
def test_the_bank_equals_matrix_filters_for_every_kind_of_mode(options):
    # The second segment begins with the covariance of a filter that has followed the object.
    matrices = described("car")
    env = HybridTrackVectorEnv(
        LANES,
        tick_info=True,
        bank_info=True,
        modes=tuple(matrices),
        scheme="12 drag, 40 singer",
        **SCALES["car"] | options,
    )
    env.reset(seed=4)
    _, *_, info = env.step(np.full(LANES, len(matrices) - 1))
    banks = [filters_of_modes(env, i, matrices) for i in range(LANES)]
    for _ in range(25):
        for i, filters in enumerate(banks):
            step_filters(filters, env, i, env.world.field("measurement")[i])
        for name, expected in bank_values(banks):
            # Of a filter, or of all filters of a track.
            shape = expected.shape[:2] + (-1,) * (expected.ndim > 2)
            agree(info[name].reshape(shape), expected.reshape(shape), name)
        *_, info = env.step(np.zeros(LANES, np.int64))
    assert (info["tick"] == 26).all()


UNKNOWN = {
    "unequal": UNEQUAL,
    "sensors, missed": {"sensors": SENSORS, "missed": 0.3},
    "range rates": {"sensors": DOPPLER, "missed": 0.3},
    "robust": {"likelihood": f"student_t {FREEDOM}", "missed": 0.2, "noise": "outliers 0.2"},
}


@pytest.mark.parametrize("options", UNKNOWN.values(), ids=UNKNOWN)
def test_the_imm_bank_equals_the_literal_one_for_any_transition_matrix(options):
    matrices = described("car")
    M = len(matrices)
    following = np.random.default_rng(7).dirichlet(np.full(M, 0.4), M)
    np.fill_diagonal(following, 0.0)
    # A stop is followed by straight motion only.
    following[3] = np.eye(M)[0]
    following /= following.sum(1, keepdims=True)
    env = HybridTrackQuickestVectorEnv(
        LANES,
        tick_info=True,
        modes=tuple(matrices),
        ticks=40,
        durations="uniform 9-11",
        transitions=following,
        start="random",
        heading=0.3,
        initial_error=0,
        **SCALES["car"] | options,
    )
    transition = 0.9 * np.eye(M) + 0.1 * following
    start = 15.0 * np.array([0.0, np.cos(0.3), 0.0, np.sin(0.3)])
    model = transition, env.options.tau, env.options.process_variance
    freedom = FREEDOM * ("likelihood" in options)
    literal = [ImmOfModes(start, np.zeros((4, 4)), matrices, *model, freedom) for _ in range(LANES)]
    _, info = env.reset(seed=5)
    for _ in range(40):
        for i, filters in enumerate(literal):
            step_filters([filters], env, i, env.world.field("measurement")[i])
        bank = env.world.bank.hypotheses[0]
        names = ("x", "vx", "y", "vy", "centre_x", "centre_y")
        states = np.stack([bank[name].T for name in names], -1)
        agree(states, [filters.states for filters in literal], "states")
        agree(bank["log_likelihood"].T, [each.log_likelihood for each in literal], "likelihood")
        probability = [filters.probability for filters in literal]
        agree(np.exp(info["log_probability"]), probability, "probability")
        agree(info["estimate"], [filters.estimate[:4] for filters in literal], "estimate")
        *_, info = env.step(np.zeros(LANES, np.int64))


def errors_of_true_modes(tracks, scale, **options):
    """Return the normalized innovation squared and the normalized estimation error squared of the
    filter of the true mode at the 20th tick of every segment, by modes. Ticks of one segment are
    correlated; its true mode is declared, so that the next anchor is that of its filter. The object
    never loses its velocity, of which turns and accelerations have their heading.
    """
    modes = tuple(mode for mode in every_mode(scale) if not isinstance(mode, Halt))
    chosen = SCALES[scale] | options
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
            errors = {
                "innovations": info["innovations"][every, true],
                "estimates": info["estimates"][every, true] - info["truth"],
            }
            spreads = info["innovation_covariances"], info["covariances"]
            both = [
                normalized_squares(e, P[every, true])
                for e, P in zip(errors.values(), spreads, strict=True)
            ]
            for index, mode in enumerate(modes):
                squares[mode].append(np.array(both)[:, true == index])
        *_, info = env.step(np.where(tick % 20 == 19, true + 1, 0))
    return {mode: np.hstack(parts) for mode, parts in squares.items()}


@pytest.mark.parametrize("scale", SCALES)
@pytest.mark.parametrize(
    "tracks",
    [pytest.param(4_000, id="quick"), pytest.param(50_000, id="study", marks=pytest.mark.study)],
)
def test_the_filter_of_the_true_mode_is_consistent_at_every_scale(scale, tracks):
    for mode, (innovations, errors) in errors_of_true_modes(tracks, scale).items():
        assert innovations.size > 0.25 * tracks
        assert inside(innovations.sum(), 2 * innovations.size), (mode, innovations.mean() / 2)
        assert inside(errors.sum(), 4 * errors.size), (mode, errors.mean() / 4)


def test_the_same_bounds_are_exceeded_by_an_object_with_more_noise():
    # A mode with noise of its own has it in object and filter.
    larger = 4.0 * SCALES["car"]["process_variance"]
    for mode, (_, errors) in errors_of_true_modes(4_000, "car", object_variance=larger).items():
        assert inside(errors.sum(), 4 * errors.size) == (mode.name in ("drag", "singer")), mode
