"""Every bank equals its filters in matrix form, in every lane, also with missing measurements
and sensors.
"""

import itertools
import math

import numpy as np
import pytest
from matrix_filters import FREEDOM, LiteralImm, bank_values, step_filters, transition_matrix
from own_modes import filters_of_modes

from hybrid_env import (
    HybridTrackEnv,
    HybridTrackQuickestEnv,
    HybridTrackQuickestVectorEnv,
    HybridTrackVectorEnv,
    KalmanBank,
    Radar,
    Sensor,
)
from hybrid_env.core.memory import LANES
from hybrid_env.live import SQUARE

STATE = ("x", "vx", "y", "vy")
TRIANGLE = np.triu_indices(4)
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
# A velocity, and a range rate after it.
VELOCITIES = (Sensor(variance=0.4, velocity_variance=0.01), DOPPLER[3])
# A camera at every tick, a beacon, and a position at every fifth tick.
LINES = (
    Radar(bearing_deviation=0.02, position=(-20.0, 3.0)),
    Radar(range_deviation=0.3, position=(5.0, -30.0), period=2),
    Sensor(variance=0.4, period=5),
)
MEASURED = {
    "unequal": UNEQUAL,
    "sensors": {"sensors": SENSORS, "missed": 0.4, "noise": "levy 1.5 0.5 44"},
    "range rates": {"sensors": DOPPLER, "missed": 0.3},
    "velocities": {"sensors": VELOCITIES, "missed": 0.3},
    "bearings and ranges": {"sensors": LINES, "missed": 0.2},
}
HEAVY = {"noise": "levy 1.2"}
ROBUST = {
    "robust, radars": {
        "likelihood": f"student_t {FREEDOM}",
        "sensors": RADARS,
        "noise": "outliers 0.2",
    },
    "robust, missed": {"likelihood": f"student_t {FREEDOM}", "missed": 0.3} | UNEQUAL | HEAVY,
}
DRIFT = {"drift": {"drift_variance": 0.02, "missed": 0.2}}
ANNOUNCED = [
    *(
        pytest.param({"bank": "published"} | options, id=f"published, {k}")
        for k, options in (MEASURED | ROBUST).items()
    ),
    *(
        pytest.param({"bank": "anchor_aware"} | options, id=f"aware, {k}")
        for k, options in (MEASURED | ROBUST | DRIFT).items()
    ),
    pytest.param({"reset_covariance": False} | UNEQUAL, id="published, kept covariance"),
    pytest.param(
        {"follow": "bank", "reset_covariance": True} | ROBUST["robust, missed"],
        id="published, merged",
    ),
]


def check_rows(env, rows, measurement):
    """Check that innovations are exactly zero in ticks without a measurement, and nowhere else."""
    layout = env.world.layout
    white = np.hstack([layout.read(rows, f"innovation_{axis}") for axis in ("along", "across")])
    np.testing.assert_array_equal((white == 0).all(1), np.isnan(measurement[:, 0]))
    assert env.observation_space.contains(rows)


@pytest.mark.parametrize("options", ANNOUNCED)
def test_a_bank_equals_matrix_filters_from_a_switch_on(options):
    # The second segment begins with the covariance of a filter that has followed the object.
    env = HybridTrackVectorEnv(
        LANES,
        tick_info=True,
        bank_info=True,
        scheme="L12r9 L40r9",
        radii=(2.0, 9.0, 200.0),
        **options,
    )
    env.reset(seed=4)
    rows, *_, info = env.step(np.full(LANES, 3))
    modes = dict.fromkeys(env.options.all_modes)
    banks = [filters_of_modes(env, i, modes) for i in range(LANES)]
    aware = env.options.bank == "anchor_aware"
    rtol, atol = (1e-5, 1e-7) if aware else (1e-9, 1e-9)
    for _ in range(25):
        for i, filters in enumerate(banks):
            step_filters(filters, env, i, env.world.field("measurement")[i])
        for name, expected in bank_values(banks):
            np.testing.assert_allclose(info[name], expected, rtol, atol, err_msg=name)
        check_rows(env, rows, env.world.field("measurement"))
        rows, *_, info = env.step(np.zeros(LANES, np.int64))


UNKNOWN = (
    {"hazard 0": {"hazard": 0.0, "measurement_variance": 3.0}, "hazard 0.8": {"hazard": 0.8}}
    | MEASURED
    | ROBUST
    | DRIFT
)


@pytest.mark.parametrize("options", UNKNOWN.values(), ids=UNKNOWN)
def test_the_imm_bank_equals_the_literal_one(options):
    ticks = 50
    radii = (2.0, 9.0)
    env = HybridTrackQuickestVectorEnv(
        LANES,
        tick_info=True,
        radii=radii,
        ticks=ticks,
        durations="uniform 9-30",
        start="random",
        heading=0.3,
        initial_error=0,
        **options,
    )
    chosen = env.options
    matrix = transition_matrix(5, chosen.assumed_hazard)

    np.testing.assert_allclose(chosen.transition_matrix, matrix)
    start = [0.0, 2.0 * math.cos(0.3), 0.0, 2.0 * math.sin(0.3)]
    curvatures = [0.0, 0.5, 1 / 9, -0.5, -1 / 9]
    model = (
        matrix,
        chosen.tau,
        chosen.process_variance,
        [1.0, 1.0],
        FREEDOM * (str(chosen.likelihood) != "gaussian"),
        chosen.drift_variance,
    )
    literal = [LiteralImm(start, np.zeros((4, 4)), curvatures, *model) for _ in range(LANES)]
    rows, info = env.reset(seed=5)
    for _ in range(ticks):
        for i, filters in enumerate(literal):
            step_filters([filters], env, i, env.world.field("measurement")[i])
        bank = env.world.bank.hypotheses[0]
        states = np.stack([bank[name] for name in STATE], -1).swapaxes(0, 1)
        np.testing.assert_allclose(
            states, [filters.states for filters in literal], rtol=1e-8, atol=1e-8
        )
        P = [[matrix[TRIANGLE] for matrix in filters.covariances] for filters in literal]
        np.testing.assert_allclose(bank["covariance"].transpose(2, 0, 1), P, rtol=1e-7, atol=1e-10)
        np.testing.assert_allclose(
            bank["log_likelihood"].T, [filters.log_likelihood for filters in literal], rtol=1e-7
        )
        probability = [filters.probability for filters in literal]
        np.testing.assert_allclose(
            np.exp(info["log_probability"]), probability, rtol=1e-7, atol=1e-9
        )
        np.testing.assert_allclose(
            info["estimate"], [filters.estimate for filters in literal], rtol=1e-8, atol=1e-8
        )
        merged = [filters.covariance[TRIANGLE] for filters in literal]
        np.testing.assert_allclose(env.world.field("covariance"), merged, rtol=1e-7, atol=1e-9)
        check_rows(env, rows, env.world.field("measurement"))
        rows, *_, info = env.step(np.zeros(LANES, np.int64))
    assert (env.world.field("segment") > 0).all()


def test_the_oracle_bank_is_anchored_at_the_true_state():
    env = HybridTrackEnv(bank="oracle", scheme="L30r5 S20", heading=0.5)
    _, info = env.reset(seed=4)

    np.testing.assert_allclose(info["anchor"], [0, 2 * np.cos(0.5), 0, 2 * np.sin(0.5)], atol=1e-15)
    # A wrong decision does not change the next anchor.
    _, _, _, _, info = env.step(3)
    assert not info["correct"]
    assert np.hypot(*(info["anchor"] - info["truth"])[[0, 2]]) < 0.3


def test_a_diverged_filter_loses_likelihood_and_stays_finite():
    env = HybridTrackEnv(bank="anchor_aware", scheme="S9")
    env.reset(seed=0)
    bank = env.world.bank.hypotheses[0]
    bank["covariance"][1, 0], bank["covariance"][2, 0] = np.nan, 1e30
    for _ in range(5):
        *_, info = env.step(0)
    log_likelihood = info["log_likelihood"]

    assert np.isfinite(log_likelihood).all()
    assert log_likelihood[0] > max(log_likelihood[1:]) + 1000
    assert np.isfinite(bank["x"][:, 0]).all()


MERGED = {"radii": (3.0, 8.0), "measurement_variance": (0.5, 2.0)}


def posterior(log_likelihood):
    weights = np.exp(log_likelihood - log_likelihood.max())
    return weights / weights.sum()


def test_the_anchor_is_the_mixture_of_the_filters():
    """One segment is repeated with `KalmanBank`, from the measurements in the trace."""
    env = HybridTrackVectorEnv(3, follow="bank", trace_rows=200, **MERGED)
    env.reset(seed=1)
    anchors = env.world.field("anchor")
    kept = env.world.field("covariance")
    first = [env.world.read_trace(i)[0, 4:6] for i in range(3)]
    env.step(np.array([1, 2, 4]))
    for i in range(3):
        # The last row is the first tick of the next segment.
        trace = env.world.read_trace(i)[:-1]
        bank = KalmanBank(radii=(3.0, 8.0), measurement_variance=(0.5, 2.0))
        bank.anchor(anchors[i], kept[i][SQUARE])
        for measurement in (first[i], *trace[:, 4:6]):
            log_likelihood = bank.step(measurement)
            weights = posterior(log_likelihood)
            mean = weights @ bank.estimates
        np.testing.assert_allclose(env.world.field("anchor")[i], mean, rtol=1e-9)
        np.testing.assert_allclose(trace[-1, 6:8], mean[[0, 2]], rtol=1e-9)
        expected = np.zeros((4, 4))
        for h in range(5):
            deviation = bank.estimates[h] - mean
            expected += weights[h] * (bank.covariances[h] + np.outer(deviation, deviation))
        covariance = env.world.field("covariance")[i]
        np.testing.assert_allclose(covariance, expected[np.triu_indices(4)], rtol=1e-7, atol=1e-12)


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


def test_probabilities_equal_enumeration_where_mixing_is_exact():
    # An object at rest, whose filters agree in all modes: only the transition matrix moves the
    # probabilities.
    env = HybridTrackQuickestEnv(speed=1e-9, process_variance=0.0, initial_error=0, hazard=0.1)
    env.reset(seed=1)
    start = (0.7, 0.2, 0.1)
    env.world.bank.hypotheses["log_probability"][0, :, 0] = np.log(start)
    histories = {(mode,): probability for mode, probability in enumerate(start)}
    for _ in range(6):
        *_, info = env.step(0)
        histories = {
            (*history, mode): probability * (0.9 if mode == history[-1] else 0.05)
            for (history, probability), mode in itertools.product(histories.items(), range(3))
        }
        total = [
            sum(p for history, p in histories.items() if history[-1] == mode) for mode in range(3)
        ]
        np.testing.assert_allclose(np.exp(info["log_probability"]), total, rtol=0, atol=1e-8)


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
