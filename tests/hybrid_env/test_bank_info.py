"""What the filters tell in `info` is that of `KalmanBank` and of filters in matrix form."""

import numpy as np
import pytest
from hostile_input import refused
from matrix_filters import filters_at_switch, step_filters

from hybrid_env import (
    HybridTrackEnv,
    HybridTrackQuickestEnv,
    HybridTrackQuickestVectorEnv,
    HybridTrackVectorEnv,
    KalmanBank,
    Radar,
    Sensor,
)
from hybrid_env.live import SQUARE
from hybrid_env.registration import BANK_RADII

NAMES = ("innovations", "innovation_covariances", "estimates", "covariances")
UNEQUAL = {"measurement_variance": (0.05, 0.4)}
RADARS = (
    Radar(range_deviation=0.1, bearing_deviation=0.02, position=(-20.0, 3.0)),
    Sensor(variance=0.3, period=3),
    Radar(
        range_deviation=0.5,
        bearing_deviation=0.005,
        position=(3.0, 30.0),
        period=2,
    ),
)
DOPPLER = Radar(
    range_deviation=0.2,
    bearing_deviation=0.03,
    rate_deviation=0.1,
    position=(20.0, 3.0),
)
MEASURED = {
    "equal axes": {},
    "unequal axes": UNEQUAL,
    "missed": UNEQUAL | {"missed": 0.4},
    "sensors": {
        "sensors": (Sensor(variance=0.4, period=2), Sensor(variance=0.05, period=3)),
        "missed": 0.3,
    },
    "radars": {"sensors": RADARS},
    "range rate": {"sensors": (DOPPLER, *RADARS), "missed": 0.3},
}
KEPT = {
    "published": {"bank": "published"},
    "kept covariance": {"bank": "published", "reset_covariance": False},
    "anchor-aware": {"bank": "anchor_aware"},
    "published, follow the bank": {"bank": "published", "follow": "bank"},
    "anchor-aware, follow the bank": {"bank": "anchor_aware", "follow": "bank"},
}
HYPOTHESES = {3: (5.0,), 21: BANK_RADII}


@pytest.mark.parametrize("measured", MEASURED.values(), ids=MEASURED)
@pytest.mark.parametrize("bank", KEPT.values(), ids=KEPT)
@pytest.mark.parametrize("radii", HYPOTHESES.values(), ids=HYPOTHESES)
def test_info_equals_filters_in_matrix_form(radii, bank, measured):
    env = HybridTrackVectorEnv(
        2,
        bank_info=True,
        tick_info=True,
        scheme="L9r5 L30r5",
        radii=radii,
        **bank,
        **measured,
    )
    env.reset(seed=4)
    *_, info = env.step(np.full(2, 2))

    assert info["segment"].tolist() == [1, 1]
    filters = [filters_at_switch(env, track) for track in range(2)]
    aware = env.options.bank == "anchor_aware"
    missing = 0
    for _ in range(15):
        for track, own in enumerate(filters):
            measurement = info["measurement"][track]
            missing += np.isnan(measurement[0])
            step_filters(own, env, track, measurement)
            expected = {
                "innovations": [one.innovation for one in own],
                "innovation_covariances": [one.Sigma for one in own],
                "estimates": [one.s[:4] if aware else one.x for one in own],
                "covariances": [one.P[:4, :4] for one in own],
            }
            for name, value in expected.items():
                assert info[f"_{name}"][track]
                np.testing.assert_allclose(
                    info[name][track],
                    value,
                    rtol=1e-9,
                    atol=1e-9,
                    err_msg=name,
                )
        *_, info = env.step(np.zeros(2, np.int64))
    assert (missing > 0) == (env.options.missed > 0)


@pytest.mark.parametrize("measured", ["equal axes", "unequal axes", "missed"])
@pytest.mark.parametrize("bank", KEPT.values(), ids=KEPT)
@pytest.mark.parametrize("radii", HYPOTHESES.values(), ids=HYPOTHESES)
def test_info_equals_a_kalman_bank_from_the_anchor_on(radii, bank, measured):
    env = HybridTrackEnv(
        bank_info=True,
        scheme="random 3x5-12",
        radii=radii,
        **bank,
        **MEASURED[measured],
    )
    identity = env.options.parameters()["reset_covariance"][0]
    own = KalmanBank(
        radii,
        measurement_variance=env.options.measurement_variance,
        bank=env.options.bank,
    )
    _, info = env.reset(seed=3)
    missing = done = False
    for action in [0, 0, 0, 0, 2] * 12:
        if info["tick"] == 1 or done:
            own.anchor(
                info["anchor"],
                np.eye(4) if identity else env.world.field("covariance")[0][SQUARE],
            )
        missing |= np.isnan(info["measurement"][0])
        np.testing.assert_allclose(
            own.step(info["measurement"]),
            info["log_likelihood"],
            rtol=1e-9,
            atol=1e-9,
        )
        for name in NAMES:
            np.testing.assert_allclose(
                info[name],
                getattr(own, name),
                rtol=1e-9,
                atol=1e-12,
                err_msg=name,
            )
        *_, done, _, info = env.step(action)
        if done:
            _, info = env.reset()

    assert missing == (measured == "missed")


@pytest.mark.parametrize("bank", ["published", "anchor_aware"])
def test_a_missed_tick_has_no_innovation_and_the_covariance_of_the_prediction_with_noise(bank):
    env = HybridTrackEnv(bank_info=True, bank=bank, missed=0.5, **UNEQUAL)
    _, info = env.reset(seed=1)
    missed = 0
    for _ in range(40):
        missing = np.isnan(info["measurement"][0])
        missed += missing
        np.testing.assert_array_equal(np.isnan(info["innovations"]), missing)
        assert np.isfinite(info["innovation_covariances"]).all()
        # The filters only predict: their present covariance is the predicted one.
        if missing:
            expected = info["covariances"][:, ::2, ::2] + np.diag([0.05, 0.4])
            np.testing.assert_allclose(info["innovation_covariances"], expected, rtol=1e-12)
        *_, info = env.step(0)

    assert 10 < missed < 30


@pytest.mark.parametrize("measured", ["unequal axes", "missed", "radars"])
@pytest.mark.parametrize("bank", KEPT.values(), ids=KEPT)
@pytest.mark.parametrize("tick_info", [True, False])
def test_the_vector_environment_tells_the_same_with_the_same_keys_in_every_step(
    bank,
    measured,
    tick_info,
):
    tracks = 9
    options = {
        "scheme": "random 2x3-9",
        **bank,
        **MEASURED[measured],
    }
    vector = HybridTrackVectorEnv(tracks, bank_info=True, tick_info=tick_info, **options)
    singles = [HybridTrackEnv(bank_info=True, **options) for _ in range(tracks)]
    _, info = vector.reset(seed=7)
    others = [single.reset(seed=7 + track)[1] for track, single in enumerate(singles)]
    keys = {name for name in info if name in NAMES}
    single_keys = set(others[0])
    generator = np.random.default_rng(0)
    done = np.zeros(tracks, bool)
    for _ in range(60):
        assert {name for name in info if name in NAMES} == keys == set(NAMES)
        for track, other in enumerate(others):
            assert set(other) >= single_keys
            for name in NAMES:
                assert info[f"_{name}"][track]
                np.testing.assert_array_equal(
                    info[name][track],
                    other[name],
                    err_msg=name,
                )
        actions = np.where(
            generator.random(tracks) < 0.2,
            generator.integers(1, 4, tracks),
            0,
        )
        restarted = done
        *_, done, _, info = vector.step(actions)
        for track, single in enumerate(singles):
            others[track] = (
                single.reset()[1] if restarted[track] else single.step(actions[track])[-1]
            )


@pytest.mark.parametrize("make", [HybridTrackEnv, HybridTrackVectorEnv])
def test_without_the_option_info_has_no_filters_in_it(make):
    assert not {*make().reset(seed=0)[1]} & {*NAMES}


def test_what_was_told_of_a_tick_stays_the_same_in_the_next_one():
    env = HybridTrackEnv(bank_info=True)
    _, info = env.reset(seed=0)
    before = {name: info[name].copy() for name in NAMES}
    *_, later = env.step(0)
    for name in NAMES:
        np.testing.assert_array_equal(info[name], before[name])
        assert (later[name] != before[name]).any()


@pytest.mark.parametrize("make", [HybridTrackEnv, HybridTrackVectorEnv])
@pytest.mark.parametrize("value", [1, "yes", None])
def test_other_values_of_the_option_are_refused_in_one_line(make, value):
    assert refused(make, bank_info=value).startswith("bank_info=")


@pytest.mark.parametrize("make", [HybridTrackQuickestEnv, HybridTrackQuickestVectorEnv])
def test_with_unknown_switches_the_option_is_refused_in_one_line(make):
    assert refused(make, bank_info=True).startswith("bank_info=True")
