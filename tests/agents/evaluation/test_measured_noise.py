"""The law of the noise, measured from an environment's measurements."""

import pytest
from own_noise import Rounded

from agents.evaluation import measured_noise
from agents.evaluation.task import task_of
from hybrid_env.noises import GaussianNoise, LevyNoise, OutlierNoise, StudentNoise

THREE, BANK, QUICKEST = (
    f"HybridTrack{name}-v0" for name in ("Published", "PublishedBank", "Quickest")
)
WALKER = {
    "speed": 1.4,
    "radii": (2.0,),
    "measurement_variance": 9.0,
    "process_variance": 0.01,
    "tau": 1.0,
}
SHIP = {
    "speed": 8.0,
    "radii": (400.0, 900.0),
    "measurement_variance": 100.0,
    "process_variance": 0.01,
    "tau": 5.0,
}


@pytest.fixture(autouse=True)
def _few_measurements(monkeypatch):
    monkeypatch.setattr(measured_noise, "TICKS", 25)


def law_of(env_id=THREE, **options):
    # Not the cached function: the law of fewer measurements is for these tests only.
    return measured_noise.measured_noise.__wrapped__(task_of(env_id, options).options)


@pytest.mark.parametrize(
    ("env_id", "options"), [(THREE, WALKER), (BANK, {"missed": 0.2}), (QUICKEST, SHIP)]
)
def test_normal_noise_is_found_to_be_normal_at_any_scale(env_id, options):
    assert isinstance(law_of(env_id, **options), GaussianNoise)


def test_the_laws_are_told_apart_and_their_numbers_found():
    law = law_of(noise="outliers 0.05 8")
    assert isinstance(law, OutlierNoise)
    # 6,000 measurements, about 300 outliers.
    assert law.share == pytest.approx(0.05, rel=0.3)
    assert law.ratio == pytest.approx(8.0, rel=0.2)
    law = law_of(QUICKEST, noise="student_t 3", **SHIP)
    assert isinstance(law, StudentNoise)
    assert law.freedom == pytest.approx(3.0, rel=0.15)
    law = law_of(noise="levy 1.5 0.7 100")
    assert isinstance(law, LevyNoise)
    assert law.index == pytest.approx(1.5, rel=0.1)
    assert law.scale == pytest.approx(0.7, rel=0.1)
    # Rounding adds step^2 / 12 to the variance.
    assert isinstance(law_of(noise=Rounded(0.1)), GaussianNoise)


def test_the_true_law_is_not_read(monkeypatch):
    """Only the measurements of the environment with the true law may differ."""
    seen = []
    true = measured_noise._histogram

    def histogram(options, noise, seed):
        seen.append(str(noise))
        return true(options, "gaussian", seed)

    monkeypatch.setattr(measured_noise, "_histogram", histogram)

    assert isinstance(law_of(noise="levy 1.2"), GaussianNoise)
    assert len(seen) == 2
