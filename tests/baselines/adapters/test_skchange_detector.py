"""The mode detector passes the estimator checks of scikit-learn as skchange's own detectors do."""

import numpy as np
import pytest

from baselines import ShiryaevRobertsDecider
from hybrid_env.checks import ArgumentError
from hybrid_env.simulation import simulate

pytest.importorskip("skchange")

from skchange.detectors import is_change_detector
from skchange.metrics import hausdorff_metric
from sklearn.base import clone
from sklearn.utils.estimator_checks import check_estimator

from baselines.adapters import ModeDetector

# Skchange expects the same of all of its detectors.
OTHER_BY_NATURE = {
    "check_methods_subset_invariance": "a change needs more than one row",
    "check_methods_sample_order_invariance": "rows are in the order of time",
}


def test_it_passes_check_estimator():
    results = check_estimator(
        ModeDetector(),
        expected_failed_checks=OTHER_BY_NATURE,
        on_fail="raise",
        on_skip=None,
    )
    assert {one["status"] for one in results} <= {"passed", "xfail", "skipped"}
    assert sum(one["status"] == "passed" for one in results) >= 38
    assert is_change_detector(ModeDetector())


@pytest.mark.parametrize("decider", [None, ShiryaevRobertsDecider(8.0)])
@pytest.mark.parametrize("unit", [1.0, 1000.0])
def test_it_finds_the_switches_of_a_simulated_track(decider, unit):
    track = (
        unit * simulate("S80 L80r5 S60 R80r5", seed=1, measurement_variance=0.01).measurements[0]
    )
    detector = clone(ModeDetector(decider)).fit(track)
    found = detector.predict(track)

    assert hausdorff_metric([80, 160, 220], found) <= 15
    assert detector.predict_modes(track)[[40, 140, 210, 290]].tolist() == [0, 1, 0, 2]


@pytest.mark.parametrize("decider", [None, ShiryaevRobertsDecider(8.0)])
def test_changes_are_where_they_happened_not_where_they_were_decided(decider):
    switches = np.array([80, 160, 220])
    errors = []
    for seed in range(6):
        track = simulate("S80 L80r5 S60 R80r5", seed=seed, measurement_variance=0.01).measurements[
            0
        ]
        found = ModeDetector(decider).fit(track).predict(track)
        errors += [found[np.abs(found - switch).argmin()] - switch for switch in switches]
    # Decisions are 11 rows late.
    assert abs(np.mean(errors)) < 3.0
    assert np.quantile(np.abs(errors), 0.9) <= 6


def test_a_decider_for_announced_switches_is_refused():
    track = simulate("S80 L80r5", seed=3, measurement_variance=0.01).measurements[0]
    with pytest.raises(ArgumentError, match="decider="):
        ModeDetector("ate").fit(track).predict(track)
