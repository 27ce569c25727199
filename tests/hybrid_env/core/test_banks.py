"""Every bank equals its filters in matrix form, in every lane, also with missing measurements,
sensors, modes of the user and heights.
"""

import numpy as np
import pytest
from matrix_filters import FREEDOM, merged
from own_modes import SCALES, ImmOfModes, every_mode, filters_of_modes, step_filters
from scipy.special import softmax

from hybrid_env import (
    HybridTrackEnv,
    HybridTrackQuickestVectorEnv,
    HybridTrackVectorEnv,
    KalmanBank,
    Radar,
    Sensor,
)
from hybrid_env.core.memory import LANES
from hybrid_env.modes import Climb, parse_modes

STATE = ("x", "vx", "y", "vy", "centre_x", "centre_y")
TRIANGLE = np.triu_indices(4)
AWARE = {"bank": "anchor_aware"}
UNEQUAL = {"measurement_variance": (0.05, 0.2), "process_variance": 0.02, "tau": 0.15}
SENSORS = (Sensor(variance=0.4, period=2), Sensor(variance=0.05, position=(3.0, 4.0), range=4.0))
RADARS = (
    Radar(range_deviation=0.1, bearing_deviation=0.02, position=(-20.0, 3.0)),
    Sensor(variance=0.3, period=3),
)
DOPPLER = (
    *RADARS,
    Radar(
        range_deviation=1.0,
        bearing_deviation=0.01,
        rate_deviation=0.3,
        position=(0.0, -30.0),
        period=2,
    ),
    Radar(range_deviation=0.2, bearing_deviation=0.03, rate_deviation=0.1, position=(20.0, 3.0)),
)
CAR_SENSORS = (
    Sensor(variance=2.0, period=2),
    Sensor(variance=0.5, position=(9.0, 5.0), range=30.0),
)
CAR_DOPPLER = (
    Radar(range_deviation=1.0, bearing_deviation=0.01, rate_deviation=0.3, position=(0.0, -60.0)),
    Sensor(variance=2.0, velocity_variance=0.04),
)
# A velocity, and a range rate after it.
VELOCITIES = (Sensor(variance=0.4, velocity_variance=0.01), DOPPLER[3])
# A camera at every tick, a beacon, and a position at every fifth tick.
LINES = (
    Radar(bearing_deviation=0.02, position=(-20.0, 3.0)),
    Radar(range_deviation=0.3, position=(5.0, -30.0), period=2),
    Sensor(variance=0.4, period=5),
)
TURNS = {"radii": (2.0, 9.0, 200.0)}
MEASURED = {
    "unequal": UNEQUAL,
    "sensors": {"sensors": SENSORS, "missed": 0.4, "noise": "levy 1.5 0.5 44"},
    "range rates": {"sensors": DOPPLER, "missed": 0.3},
    "velocities": {"sensors": VELOCITIES, "missed": 0.3},
    "bearings and ranges": {"sensors": LINES, "missed": 0.2},
    "robust, radars": {
        "likelihood": f"student_t {FREEDOM}",
        "sensors": RADARS,
        "noise": "outliers 0.2",
    },
    "robust, missed": {"likelihood": f"student_t {FREEDOM}", "missed": 0.3, "noise": "levy 1.2"}
    | UNEQUAL,
}
DRIFT = {"drift": {"drift_variance": 0.02, "missed": 0.2}}
# Modes of all kinds, and pairs of those of the plane with climbs.
MODES = {"modes": every_mode()} | SCALES["car"]
PAIRS = {
    "modes": tuple(
        parse_modes([*(every_mode()[k] for k in (0, 1, 3, 5)), Climb(2.0), Climb(-1.0)])
    ),
    "climb_variance": 0.002,
    "height_variance": 0.5,
    "initial_error": (0.3, 0.1),
} | SCALES["car"]
# Turns and accelerations have the heading of the velocity, which a halt loses.
KEEPS_SPEED = {"scheme": "12 drag, 12 singer, 12 straight"}
OF_MODES = {
    "modes, sensors": {"sensors": CAR_SENSORS, "missed": 0.2} | MODES,
    "modes, range rates": {"sensors": CAR_DOPPLER} | MODES,
    "modes, robust": {"likelihood": f"student_t {FREEDOM}", "noise": "levy 1.4"} | MODES,
}
OF_PAIRS = {"pairs": PAIRS, "pairs, missed": {"missed": 0.3, "noise": "student_t 3"} | PAIRS}
KEPT = {"reset_covariance": False}
ANNOUNCED = {
    **{f"published, {name}": TURNS | given for name, given in MEASURED.items()},
    **{f"aware, {name}": AWARE | TURNS | given for name, given in (MEASURED | DRIFT).items()},
    "published, kept covariance": TURNS | KEPT | UNEQUAL,
    "published, merged": {"follow": "bank"} | TURNS | MEASURED["robust, missed"],
    **{f"aware, {name}": AWARE | KEEPS_SPEED | given for name, given in OF_MODES.items()},
    "published, modes, merged": {"follow": "bank"} | KEEPS_SPEED | MODES,
    "published, modes, missed": {"missed": 0.3} | KEEPS_SPEED | MODES,
    **{f"aware, {name}": AWARE | given for name, given in OF_PAIRS.items()},
    "published, pairs": PAIRS | KEPT,
    "aware, pairs, merged": {"follow": "bank"} | AWARE | PAIRS,
}


def agree(computed, expected, name, tolerance=1e-9):
    """Check that arrays (..., k) agree within a tolerance times 1, or times the largest of each k
    numbers if it is larger.
    """
    computed, expected = np.array(computed), np.array(expected)
    np.testing.assert_array_equal(np.isnan(computed), np.isnan(expected))
    difference, expected = np.nan_to_num(computed - expected), np.nan_to_num(expected)
    largest = np.abs(expected).max(-1, keepdims=True).clip(min=1.0)
    assert (np.abs(difference) <= tolerance * largest).all(), name


def check_rows(env, rows):
    """Check that innovations are exactly zero in ticks without a measurement, and nowhere else."""
    layout = env.world.layout
    white = np.hstack([layout.read(rows, f"innovation_{axis}") for axis in ("along", "across")])
    missing = np.isnan(env.world.field("measurement")[:, 0])
    np.testing.assert_array_equal((white == 0).all(1), missing)
    assert env.observation_space.contains(rows)


def described(filters):
    """Yield names of the info of a track, with what its filters in matrix form say."""
    yield "log_likelihood", [kalman.log_likelihood for kalman in filters]
    # Zero without a measurement, where the mask says so.
    yield "innovations", [np.nan_to_num(kalman.innovation[:2]) for kalman in filters]
    yield "innovation_covariances", [kalman.Sigma[:2, :2] for kalman in filters]
    yield "estimates", [kalman.x[:4] for kalman in filters]
    yield "covariances", [kalman.P[:4, :4] for kalman in filters]
    if len(filters[0].seen) == 3:
        yield "heights", [kalman.x[-2:] for kalman in filters]
        yield "height_covariances", [kalman.P[-2:, -2:] for kalman in filters]


def next_anchor(filters, mode, options):
    """Return mean and covariance of [x, vx, y, vy] and the height after a decision."""
    weights = np.eye(len(filters))[mode]
    if options.follow == "bank":
        weights = softmax([kalman.log_likelihood for kalman in filters])
    places = [0, 1, 2, 3, *([-2] if options.climbs else [])]
    return merged(
        weights, [(kalman.x[places], kalman.P[np.ix_(places, places)]) for kalman in filters]
    )


@pytest.mark.parametrize("options", ANNOUNCED.values(), ids=ANNOUNCED)
def test_a_bank_equals_matrix_filters_from_switch_to_switch(options):
    env = HybridTrackVectorEnv(
        LANES, tick_info=True, bank_info=True, **{"scheme": "random 3x12-12"} | options
    )
    tolerance = 1e-6 if env.options.bank == "anchor_aware" and "radii" in options else 1e-9
    rows, info = env.reset(seed=4)
    banks = [None] * LANES
    for _ in range(36):
        for i in range(LANES):
            if info["tick"][i] == 1:
                height = 0.0
                if banks[i]:
                    anchor, P = next_anchor(banks[i], info["decided_mode"][i], env.options)
                    agree(info["anchor"][i], anchor[:4], "anchor", tolerance)
                    agree(env.world.field("anchor_height")[i], anchor[4:].sum(), "height")
                    height = P[4:, 4:].sum()
                    if not env.options.parameters()["reset_covariance"]:
                        agree(
                            env.world.field("covariance")[i], P[TRIANGLE], "covariance", tolerance
                        )
                banks[i] = filters_of_modes(env, i, height)
            step_filters(banks[i], env, i)
            for name, expected in described(banks[i]):
                agree(info[name][i], expected, name, tolerance)
        check_rows(env, rows)
        rows, *_, info = env.step(np.where(info["tick"] == 12, info["true_mode"] + 1, 0))


def some_order(modes):
    """Return probabilities of the next mode; the fourth is followed by straight motion only."""
    following = np.random.default_rng(7).dirichlet(np.full(len(modes), 0.4), len(modes))
    np.fill_diagonal(following, 0.0)
    following[3] = np.eye(len(modes))[0]
    return following / following.sum(1, keepdims=True)


HAZARDS = {"hazard 0": {"hazard": 0.0, "measurement_variance": 3.0}, "hazard 0.8": {"hazard": 0.8}}
UNKNOWN = {name: TURNS | given for name, given in (HAZARDS | MEASURED | DRIFT).items()} | {
    name: {"durations": "uniform 9-11", "transitions": some_order(given["modes"])} | given
    for name, given in (OF_MODES | OF_PAIRS).items()
}


@pytest.mark.parametrize("options", UNKNOWN.values(), ids=UNKNOWN)
def test_the_imm_bank_equals_the_literal_one(options):
    given = {"durations": "uniform 9-30", "start": "random", "heading": 0.3} | options
    given |= {"ticks": 40, "initial_error": 0}
    env = HybridTrackQuickestVectorEnv(LANES, tick_info=True, **given)
    M, hazard = env.options.hypotheses, env.options.assumed_hazard
    following = options.get("transitions", (1 - np.eye(M)) / (M - 1))
    transition = (1 - hazard) * np.eye(M) + hazard * following
    start = env.options.speed * np.array([0.0, np.cos(0.3), 0.0, np.sin(0.3)])
    literal = [ImmOfModes(start, np.zeros((4, 4)), env.options, transition) for _ in range(LANES)]
    rows, info = env.reset(seed=5)
    for _ in range(40):
        bank = env.world.bank.hypotheses[0]
        # Places of a centre are accelerations.
        names = [name for name in STATE if name in bank.dtype.names]
        states = np.stack([bank[name] for name in names], -1)
        for i, imm in enumerate(literal):
            step_filters([imm], env, i)
            told = {
                "states": (states[:, i], [x[: states.shape[2]] for x, _ in imm.parts]),
                "likelihood": (bank["log_likelihood"][:, i], imm.log_likelihood),
                "probability": (np.exp(info["log_probability"][i]), imm.probability),
                "estimate": (info["estimate"][i], imm.estimate[:4]),
                "covariance": (env.world.field("covariance")[i], imm.covariance[TRIANGLE]),
            }
            if env.options.climbs:
                told["height"] = info["height_estimate"][i], imm.estimate[6:]
                variances = env.world.field("height_variances")[i]
                told["variances"] = variances, imm.covariance.diagonal()[6:]
            for name, (computed, expected) in told.items():
                agree(computed, expected, name, 1e-8)
        check_rows(env, rows)
        rows, *_, info = env.step(np.zeros(LANES, np.int64))
    assert (env.world.field("segment") > 0).all()


def test_the_oracle_bank_is_anchored_at_the_true_state():
    env = HybridTrackEnv(bank="oracle", scheme="L30r5 S20")
    env.reset(seed=4)
    # A wrong decision does not change the next anchor.
    _, _, _, _, info = env.step(3)
    assert not info["correct"]
    assert np.hypot(*(info["anchor"] - info["truth"])[[0, 2]]) < 0.3


@pytest.mark.parametrize(("tau", "rate"), [(0.1, 0.0), (1e4, 1e-6), (1e9, 0.3)])
def test_a_covariance_much_larger_than_the_noise_stays_positive_semidefinite(tau, rate):
    # The corrected velocity variance is smaller than the rounding error of the predicted one.
    for R in (1e-18, 1e-6, 1.0):
        bank = KalmanBank([1.0], tau, 0.0, R)
        # Whose turns have this rate in a tick.
        bank.anchor([0.0, rate / tau, 0.0, 0.0])
        for _ in range(300):
            bank.step([0.0, 0.0])
            assert (bank.innovation_covariances[:, [0, 1], [0, 1]] >= R * (1 - 1e-9)).all()
            assert (np.diagonal(bank.covariances, 0, 1, 2) >= 0.0).all()


EXTREME = [
    {"speed": 1e9, "radii": (1e12,), "measurement_variance": 1e18},
    {"speed": 1e-9, "tau": 1e-9, "measurement_variance": 1e-18, "radii": (1e-12, 1e-6)},
    {"process_variance": 1e18, "measurement_variance": 1e18, "tau": 1e-9},
    {"hazard": 0.0, "noise": "outliers 0.9", "measurement_variance": (1e3, 1e-3)},
]


@pytest.mark.parametrize("options", EXTREME, ids=str)
def test_extreme_options_give_finite_rows_inside_the_space(options):
    env = HybridTrackQuickestVectorEnv(LANES + 1, **options)
    rows, _ = env.reset(seed=1)
    for k in range(700):
        assert env.observation_space.contains(rows), k
        rows, rewards, *_ = env.step(np.full(LANES + 1, k % 3))
        assert np.isfinite(rewards).all()
