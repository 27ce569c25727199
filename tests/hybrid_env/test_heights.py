"""Environments whose modes climb and descend: banks equal literal filters of plane and height, and
are consistent at every scale.
"""

import copy
import pickle

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from hostile_input import refused
from matrix_filters import (
    MatrixExtendedKalmanFilter,
    MatrixFilter,
    MatrixKalmanFilter,
    jacobian,
    move,
)
from own_modes import SCALES, ImmOfModes, described, filters_of_modes
from scipy import linalg, stats

from hybrid_env import (
    HybridTrackQuickestVectorEnv,
    HybridTrackVectorEnv,
    InnovationsLayout,
    KalmanBank,
    Layout,
    QuickestLayout,
    QuickestOptions,
    RawLayout,
    StateLayout,
    WorldOptions,
)
from hybrid_env.core.memory import LANES
from hybrid_env.live import LiveTracks
from hybrid_env.modes import Climb, Straight, Turn, parse_modes
from hybrid_env.simulation import simulate

TEXT = "straight, left 5, right 5, climb 0.5, descend 0.3"
HEIGHTS = {"climb_variance": 0.002, "height_variance": 0.5}


def planes():
    """Return modes of the plane of several kinds, with their literal matrices."""
    matrices = described("car")
    return {mode: given for mode, given in matrices.items() if mode.name not in ("halt", "drag")}


def pairs(plane_modes, rates=(2.0, -1.0)):
    """Return the pairs of modes that the option makes of these."""
    return parse_modes([*plane_modes, *map(Climb, rates)])


def linearised(plane):
    """Return the prediction of the state of a filter of the plane, and F and Q of it."""
    if isinstance(plane, MatrixExtendedKalmanFilter):
        F = jacobian(lambda state: move(state, plane.tau), plane.x)
        if plane.x[6] == 0.0:
            F[:4, 6] = 0.0
        return move(plane.x, plane.tau), F, plane.Q
    if isinstance(plane, MatrixKalmanFilter):
        return plane.Phi @ plane.x + plane.B, plane.Phi, plane.GQG
    return plane.F @ plane.x + plane.B, plane.F, plane.Q


class SpatialFilter(MatrixFilter):
    """A filter of the states of one of the plane and of [z, vz], with full matrices."""

    def __init__(self, plane, options, rate, height, variance):
        self.plane, self.tau = plane, options.tau
        self.noise = np.diag([0.0, options.climb_variance])
        self.R = np.diag([*np.broadcast_to(options.variances, 2), options.height_variance])
        self.x = np.append(plane.x, [height, rate])
        self.P = linalg.block_diag(plane.P, np.diag([variance, 0.0]))
        self.log_likelihood = 0.0

    def step(self, z):
        """One tick; a measurement None only predicts."""
        self.plane.x = self.x[:-2]
        moved, F, Q = linearised(self.plane)
        rising = np.array([[1.0, self.tau], [0.0, 1.0]])
        F, Q = linalg.block_diag(F, rising), linalg.block_diag(Q, self.noise)
        self.x, self.P = np.append(moved, rising @ self.x[-2:]), F @ self.P @ F.T + Q
        if z is None:
            return
        H = np.zeros((3, len(self.x)))
        H[0, 0] = H[1, 2] = H[2, -2] = 1.0
        Sigma, innovation = H @ self.P @ H.T + self.R, z - H @ self.x
        K = self.P @ H.T @ np.linalg.inv(Sigma)
        self.x, self.P = self.x + K @ innovation, self.P - K @ H @ self.P
        self.log_likelihood += stats.multivariate_normal(cov=Sigma).logpdf(innovation)

    @property
    def places(self):
        """Where [x, vx, y, vy, z, vz] are in the state."""
        return [0, 1, 2, 3, len(self.x) - 2, len(self.x) - 1]


def agree(computed, expected, name):
    """Check that values agree within 1e-9 of 1, or of the largest if it is larger."""
    computed, expected = np.array(computed), np.array(expected)
    largest = np.abs(expected).max(initial=1.0)
    assert np.abs(computed - expected).max() <= 1e-9 * largest, name


ANNOUNCED = {
    "published": {},
    "aware, missed": {"bank": "anchor_aware", "missed": 0.3},
    "aware, heavy tails": {"bank": "anchor_aware", "noise": "student_t 3"},
}


@pytest.mark.parametrize("options", ANNOUNCED.values(), ids=ANNOUNCED)
def test_the_bank_equals_literal_filters_of_six_states_through_episodes(options):
    matrices = planes()
    env = HybridTrackVectorEnv(
        LANES,
        tick_info=True,
        bank_info=True,
        modes=pairs(matrices),
        scheme="random 3x9-9",
        reset_covariance=False,
        initial_error=(0.3, 0.1),
        **SCALES["car"] | HEIGHTS | options,
    )
    modes = env.options.all_modes
    _, info = env.reset(seed=4)
    banks = [None] * LANES
    for _ in range(27):
        for i in range(LANES):
            if info["tick"][i] == 1:
                anchor = np.append(info["anchor"][i], env.world.field("anchor_height")[i])
                if banks[i] is not None:
                    last = banks[i][info["decided_mode"][i]]
                    agree(anchor, last.x[last.places[:5]], "anchor")
                filters = filters_of_modes(env, i, matrices)
                variance = 0.0 if banks[i] is None else last.P[-2, -2]
                banks[i] = [
                    SpatialFilter(
                        copy.deepcopy(filters[list(matrices).index(mode.planar)]),
                        env.options,
                        mode.rate,
                        anchor[4],
                        variance,
                    )
                    for mode in modes
                ]
            measured = np.append(env.world.field("measurement")[i], env.world.field("height")[i])
            for kalman in banks[i]:
                kalman.step(None if np.isnan(measured).any() else measured)
        each = [[kalman.log_likelihood for kalman in filters] for filters in banks]
        agree(info["log_likelihood"], each, "log_likelihood")
        states = [[kalman.x[kalman.places] for kalman in filters] for filters in banks]
        agree(np.concatenate([info["estimates"], info["heights"]], -1), states, "states")
        spreads = [
            [kalman.P[np.ix_(kalman.places, kalman.places)] for kalman in filters]
            for filters in banks
        ]
        computed = np.zeros((LANES, len(modes), 6, 6))
        computed[..., :4, :4] = info["covariances"]
        computed[..., 4:, 4:] = info["height_covariances"]
        agree(computed, spreads, "covariances")
        *_, info = env.step(np.zeros(LANES, np.int64))


class ImmOfPairs(ImmOfModes):
    """The IMM of pairs, whose last states are [z, vz]. At a switch a filter brings its height, and
    the mode has the rate; plane and height stay uncorrelated.
    """

    def __init__(self, estimate, P, matrices, pairs, options, transition):
        self.pairs, self.options = pairs, options
        expanded = {mode: matrices[mode.planar] for mode in pairs}
        super().__init__(estimate, P, expanded, transition, options.tau, options.process_variance)
        start = 0.0, 0.0
        self.states = [
            np.append(x, [start[0], mode.rate]) for x, mode in zip(self.states, pairs, strict=True)
        ]
        self.covariances = [linalg.block_diag(P, np.zeros((2, 2))) for P in self.covariances]
        self.R = np.diag([*np.broadcast_to(options.variances, 2), options.height_variance])

    def mixed(self, j, weights):
        """Return state and covariance in which filter j begins a tick."""
        kept = self.states, self.covariances
        without = np.diag([1.0] * 4 + [0.0, 0.0, 1.0, 0.0])
        rate = np.append(np.zeros(7), self.pairs[j].rate)
        others = [g != j for g in range(len(weights))]
        self.states = [
            without @ x + rate if other else x for x, other in zip(kept[0], others, strict=True)
        ]
        self.covariances = [
            without @ P @ without if other else P for P, other in zip(kept[1], others, strict=True)
        ]
        mean, spread = self.merged(weights)
        self.states, self.covariances = kept
        spread[:6, 6:] = spread[6:, :6] = 0.0
        return mean, spread

    def predicted(self, j, x, P):
        """Return the prediction of filter j."""
        state, spread = super().predicted(j, x[:6], P[:6, :6])
        rising = np.array([[1.0, self.tau], [0.0, 1.0]])
        noise = np.diag([0.0, self.options.climb_variance])
        risen = rising @ P[6:, 6:] @ rising.T + noise
        return np.append(state, rising @ x[6:]), linalg.block_diag(spread, risen)

    def step(self, z):
        """One tick; a measurement None only predicts."""
        prior = self.transition.T @ self.probability
        weights = self.transition * self.probability[:, None] / prior
        begun = [self.mixed(j, column) for j, column in enumerate(weights.T)]
        logs = np.zeros(len(prior))
        H = np.eye(8)[[0, 2, 6]]
        for j, start in enumerate(begun):
            x, P = self.predicted(j, *start)
            if z is not None:
                Sigma, innovation = H @ P @ H.T + self.R, z - H @ x
                K = P @ H.T @ np.linalg.inv(Sigma)
                x, P = x + K @ innovation, P - K @ H @ P
                logs[j] = stats.multivariate_normal(cov=Sigma).logpdf(innovation)
            self.states[j], self.covariances[j] = x, P
        self.probability = prior * np.exp(logs - logs.max())
        self.probability /= self.probability.sum()
        self.estimate, self.covariance = self.merged(self.probability)


@pytest.mark.parametrize("missed", [0.0, 0.3])
def test_the_imm_bank_equals_a_literal_one_of_pairs(missed):
    matrices = planes()
    env = HybridTrackQuickestVectorEnv(
        LANES,
        tick_info=True,
        modes=pairs(matrices),
        ticks=40,
        durations="uniform 9-11",
        hazard=0.1,
        start="random",
        heading=0.3,
        initial_error=0,
        missed=missed,
        **SCALES["car"] | HEIGHTS,
    )
    modes = env.options.all_modes
    start = 15.0 * np.array([0.0, np.cos(0.3), 0.0, np.sin(0.3)])
    given = matrices, modes, env.options, env.options.transition_matrix
    literal = [ImmOfPairs(start, np.zeros((4, 4)), *given) for _ in range(LANES)]
    _, info = env.reset(seed=5)
    for _ in range(40):
        for i, filters in enumerate(literal):
            measured = np.append(env.world.field("measurement")[i], env.world.field("height")[i])
            filters.step(None if np.isnan(measured).any() else measured)
        probability = [filters.probability for filters in literal]
        agree(np.exp(info["log_probability"]), probability, "probability")
        estimates = np.array([filters.estimate for filters in literal])
        agree(info["estimate"], estimates[:, :4], "estimate")
        agree(info["height_estimate"], estimates[:, 6:], "height")
        variances = [filters.covariance.diagonal()[6:] for filters in literal]
        agree(env.world.field("height_variances"), variances, "variances")
        *_, info = env.step(np.zeros(LANES, np.int64))


def innovations_up(env):
    """Return the innovations of the heights and their variances, (N, M, 2)."""
    heights = np.moveaxis(env.world.bank.heights, -1, 1)
    return heights.reshape(-1, *heights.shape[2:])[: env.num_envs, :, 5:]


OBJECTS = {
    # Speed, tick, Q and R; radius; rates; variances of the vertical rate and of the height.
    "aircraft": (220.0, 4.0, 1.0, 2500.0, 9e3, (8.0, -6.0), 0.2, 400.0),
    "drone": (5.0, 0.05, 0.004, 0.02, 9.0, (1.5, -2.0), 0.001, 0.003),
    "glider": (28.0, 1.0, 0.3, 9.0, 120.0, (2.5, -1.2), 0.1, 2.0),
}


def options_of(name):
    """Return the options of an object, all of whose modes climb or descend or are level."""
    speed, tau, Q, R, radius, rates, climb, height = OBJECTS[name]
    modes = (Straight(), Turn(radius), Turn(-radius), *map(Climb, rates))
    return {
        "modes": modes,
        "speed": speed,
        "tau": tau,
        "process_variance": Q,
        "measurement_variance": R,
        "climb_variance": climb,
        "height_variance": height,
        "initial_error": (0.3, (0.01 * speed) ** 2),
        "bank": "anchor_aware",
    }


def squares_of_true_modes(name, tracks, **options):
    """Return the normalized squared errors of the six states, and those of the three innovations,
    of the filter of the true mode at the 20th tick of every segment. Its true mode is declared.
    """
    chosen = options_of(name) | options
    env = HybridTrackVectorEnv(
        tracks, tick_info=True, bank_info=True, scheme="random 3x30-30", **chosen
    )
    every, squares = np.arange(tracks), []
    _, info = env.reset(seed=8)
    for tick in range(60):
        true = info["true_mode"]
        if tick % 20 == 19:
            P, S = np.zeros((tracks, 6, 6)), np.zeros((tracks, 3, 3))
            P[:, :4, :4] = info["covariances"][every, true]
            P[:, 4:, 4:] = info["height_covariances"][every, true]
            S[:, :2, :2] = info["innovation_covariances"][every, true]
            up, S[:, 2, 2] = innovations_up(env)[every, true].T
            told = info["estimates"][every, true], info["heights"][every, true]
            truth = info["truth"], info["true_height"]
            error = np.hstack(told) - np.hstack(truth)
            innovation = np.hstack([info["innovations"][every, true], up[:, None]])
            squares.append(
                [
                    np.einsum("ni,ni->n", e, np.linalg.solve(A, e[..., None])[..., 0])
                    for e, A in ((error, P), (innovation, S))
                ]
            )
        *_, info = env.step(np.where(tick % 20 == 19, true + 1, 0))
    return np.hstack(squares)


def inside(squares, freedom):
    """Return True if the sum of chi-square variables is inside its two-sided bounds of 5 sigma."""
    share = stats.chi2.cdf(squares.sum(), freedom * squares.size)
    return stats.norm.sf(5.0) < share < stats.norm.cdf(5.0)


@pytest.mark.parametrize("name", OBJECTS)
@pytest.mark.parametrize(
    "tracks",
    [pytest.param(4_000, id="quick"), pytest.param(50_000, id="study", marks=pytest.mark.study)],
)
def test_filters_of_six_states_are_consistent_at_every_scale(name, tracks):
    errors, innovations = squares_of_true_modes(name, tracks)
    assert inside(errors, 6), errors.mean() / 6
    assert inside(innovations, 3), innovations.mean() / 3


def test_the_same_bounds_are_exceeded_by_heavier_tails():
    assert not inside(squares_of_true_modes("drone", 1_000, noise="student_t 4")[1], 3)


def test_text_and_objects_name_the_same_pairs():
    modes = parse_modes(TEXT)
    names = [
        f"{plane} {height}"
        for plane in ("straight", "left 5", "right 5")
        for height in ("level", "climb 0.5", "descend 0.3")
    ]
    assert [str(mode) for mode in modes] == names
    assert parse_modes(", ".join(names)) == modes
    assert modes == parse_modes([Straight(), Turn(5.0), Turn(-5.0), Climb(0.5), Climb(-0.3)])
    assert [mode.type for mode in modes[:4]] == [
        "straight level",
        "straight climb",
        "straight descend",
        "left level",
    ]
    # A pair makes the others level.
    assert [str(mode) for mode in parse_modes("straight, left 5 descend 2")] == [
        "straight level",
        "left 5 descend 2",
    ]
    scheme = WorldOptions(modes=TEXT, scheme="9 left 5 climb 0.5, 30 straight level").scheme
    assert [piece.name for piece in scheme.pieces] == ["left 5 climb 0.5", "straight level"]


REFUSED = [
    ({"modes": "straight, climb"}, "modes='climb' is not allowed"),
    ({"modes": "straight, climb up"}, "'climb 5'"),
    ({"modes": "straight, climb 1e19"}, "modes='climb 1e19'"),
    ({"modes": "straight, sideways climb 2"}, "'sideways climb 2'"),
    ({"modes": "straight, level"}, "2 to 1,000 modes"),
    ({"modes": TEXT, "sensors": ["0.4"]}, "none with modes that climb or descend"),
    ({"modes": TEXT, "height_variance": 0.0}, "height_variance=0.0"),
    ({"modes": TEXT, "climb_variance": -1.0}, "climb_variance=-1.0"),
    ({"modes": "straight, climb 1e9", "height_variance": 1e-9}, "too many standard deviations"),
]


@pytest.mark.parametrize(("given", "reason"), REFUSED)
def test_what_is_not_allowed_is_refused_in_one_line(given, reason):
    message = refused(WorldOptions, **given)
    assert reason in message
    assert message.isprintable()


def test_simulations_of_climbs_are_refused():
    assert "modes of the plane" in refused(
        simulate, "9 straight climb 1, 9 straight level", modes="straight, climb 1"
    )


ENVS = {"HybridTrack-v0": {"scheme": "random 2x20-30"}, "HybridTrackQuickest-v0": {"ticks": 60}}


@pytest.mark.parametrize(("env_id", "options"), ENVS.items())
def test_gymnasium_finds_nothing_to_complain_about(env_id, options):
    env = gym.make(f"hybrid_env:{env_id}", modes=TEXT, **options)
    check_env(env.unwrapped)


TWINS = {"bank": Layout, "raw": RawLayout, "state": StateLayout, "innovations": InnovationsLayout}


def test_rows_tell_of_the_height_what_is_true():
    tracks = 9
    envs = {
        name: HybridTrackVectorEnv(
            tracks,
            tick_info=True,
            bank_info=True,
            observation=name,
            modes=TEXT,
            bank="anchor_aware",
            missed=0.3,
            scheme="random 2x20-30",
            height_variance=0.04,
        )
        for name in TWINS
    }
    seen = {name: env.reset(seed=2) for name, env in envs.items()}
    for _ in range(40):
        info = seen["bank"][-1]
        measured = ~np.isnan(envs["bank"].world.field("height"))
        assert (measured == info["_height"]).all()
        anchor = envs["bank"].world.field("anchor_height")
        innovation, variance = np.moveaxis(innovations_up(envs["bank"]), -1, 0)
        known = {
            "innovation_up": np.nan_to_num(innovation) / np.sqrt(variance),
            "log_variance_up": np.log(variance / 0.04),
            "climb": 0.1 * info["height_estimate"][:, 1] / 0.2,
            "displacement_up": np.where(measured, info["height"] - anchor, 0.0) / 0.2,
        }
        for name, layout in TWINS.items():
            rows, env = seen[name][0], envs[name]
            assert env.observation_space.contains(rows)
            assert env.world.layout.width == rows.shape[1]
            for feature in layout.height_features:
                read, expected = env.world.layout.read(rows, feature), known[feature]
                np.testing.assert_allclose(read, expected, rtol=1e-5, atol=1e-5, err_msg=feature)
        seen = {name: env.step(np.zeros(tracks, np.int64)) for name, env in envs.items()}
    for layout, options in ((Layout, WorldOptions), (QuickestLayout, QuickestOptions)):
        made = layout(options(modes=TEXT).hypotheses, climbs=True)
        assert layout.of_width(made.width).slices == made.slices
        widths = {layout(M).width for M in range(2, 1001)}
        assert widths.isdisjoint({layout(M, True).width for M in range(2, 1001)})


UNITS = [(HybridTrackVectorEnv, {"bank": "anchor_aware"}), (HybridTrackQuickestVectorEnv, {})]


@pytest.mark.parametrize(("make", "options"), UNITS)
def test_rows_with_heights_are_the_same_in_any_units(make, options):
    metre, second = 1e-3, 1 / 3600
    rows = []
    for m, s in ((1.0, 1.0), (metre, second)):
        v = m / s
        env = make(
            5,
            modes=(Straight(), Turn(5.0 * m), Climb(0.5 * v), Climb(-0.3 * v)),
            speed=2.0 * v,
            tau=0.1 * s,
            process_variance=0.001 * v**2,
            measurement_variance=0.1 * m**2,
            climb_variance=0.002 * v**2,
            height_variance=0.1 * m**2,
            initial_error=(0.3, 0.02 * v**2),
            missed=0.1,
            **options,
        )
        seen = [env.reset(seed=3)[0]]
        seen += [env.step(np.full(5, k % 9 == 8, np.int64))[0] for k in range(40)]
        rows.append(np.stack(seen))
    np.testing.assert_allclose(rows[1], rows[0], rtol=2e-4, atol=2e-4)


@pytest.mark.parametrize("follow", ["declared", "bank"])
def test_the_height_of_the_next_anchor_is_that_of_the_decision(follow):
    env = HybridTrackVectorEnv(
        4, tick_info=True, bank_info=True, modes=TEXT, follow=follow, scheme="random 2x20-20"
    )
    _, info = env.reset(seed=1)
    for _ in range(20):
        last, (*_, info) = info, env.step(np.zeros(4, np.int64))
    weights = np.exp(last["log_likelihood"] - last["log_likelihood"].max(1, keepdims=True))
    weights /= weights.sum(1, keepdims=True)
    if follow == "declared":
        weights = np.eye(9)[info["decided_mode"]]
    heights = (weights * last["heights"][..., 0]).sum(1)
    np.testing.assert_allclose(env.world.field("anchor_height"), heights, rtol=1e-12)
    spread = (
        last["height_covariances"][..., 0, 0] + (last["heights"][..., 0] - heights[:, None]) ** 2
    )
    # The prediction of a level filter, whose rate is exact at the switch.
    expected = (weights * spread).sum(1) + 0.1
    np.testing.assert_allclose(innovations_up(env)[:, 0, 1], expected, rtol=1e-9)


@pytest.mark.parametrize("env_id", ENVS)
def test_copies_go_on_alike(env_id):
    env = gym.make(f"hybrid_env:{env_id}", modes=TEXT, **ENVS[env_id]).unwrapped
    env.reset(seed=2)
    env.step(0)
    copies = [copy.deepcopy(env), pickle.loads(pickle.dumps(env))]
    expected = env.step(0)
    for each in copies:
        np.testing.assert_equal(each.step(0), expected)


def test_a_live_sensor_refuses_climbs():
    allowed = "modes of the plane on a live sensor"
    assert allowed in refused(KalmanBank, modes=TEXT)
    assert allowed in refused(LiveTracks, QuickestOptions(modes=TEXT))
