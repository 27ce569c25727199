"""The interacting multiple model (IMM) filter as predictor and updater of Stone Soup. Blom &
Bar-Shalom 1988.

The state of a track is a mixture with one component for each model, weighted by the probability of
the model. A normal state, as that of an initiator, begins all models alike.
"""

from typing import Any

import numpy as np
from scipy.special import softmax
from scipy.stats import multivariate_normal
from stonesoup.base import Property
from stonesoup.functions import gm_reduce_single
from stonesoup.predictor import Predictor
from stonesoup.predictor.kalman import ExtendedKalmanPredictor
from stonesoup.types.hypothesis import SingleHypothesis
from stonesoup.types.mixture import GaussianMixture
from stonesoup.types.prediction import GaussianStatePrediction, Prediction
from stonesoup.types.state import WeightedGaussianState
from stonesoup.types.update import GaussianMixtureUpdate
from stonesoup.updater.kalman import ExtendedKalmanUpdater


class MixturePrediction(Prediction, GaussianMixture):
    """A predicted mixture."""


class IMMPredictor(Predictor):
    """The prediction of an IMM filter: each model predicts its mixture of all components."""

    transition_model: Any = Property(doc="M transition models of Stone Soup")
    probabilities: Any = Property(doc="(M, M) of the next model; rows sum to 1")

    def predict(self, prior: Any, timestamp: Any = None, **kwargs: Any) -> MixturePrediction:
        """Return the mixture at a time, the next tick."""
        if not hasattr(prior, "components"):
            count = len(self.transition_model)
            one = WeightedGaussianState(prior.mean, prior.covar, prior.timestamp, 1.0 / count)
            prior = GaussianMixture([one] * count)
        # Model before, model after.
        joint = prior.weights[:, None].astype(float) * self.probabilities
        components = []
        for model, weights in zip(self.transition_model, joint.T, strict=True):
            begin = WeightedGaussianState(
                *gm_reduce_single(prior.means, prior.covars, weights),
                timestamp=prior.timestamp,
                weight=weights.sum(),
            )
            predictor = ExtendedKalmanPredictor(model)
            components.append(predictor.predict(begin, timestamp=timestamp, **kwargs))
        return MixturePrediction(components=components)


class IMMUpdater(ExtendedKalmanUpdater):
    """The correction of an IMM filter: each component is corrected, and weighed by its
    likelihood.
    """

    def predict_measurement(self, predicted_state: Any, *args: Any, **kwargs: Any) -> Any:
        """Return the measurement that a merged mixture predicts."""
        state = predicted_state
        merged = GaussianStatePrediction(state.mean, state.covar, timestamp=state.timestamp)
        return super().predict_measurement(merged, *args, **kwargs)

    def update(self, hypothesis: Any, **kwargs: Any) -> GaussianMixtureUpdate:
        """Return the mixture after the measurement of a hypothesis."""
        logs, components = [], []
        for part in hypothesis.prediction.components:
            of_part = SingleHypothesis(part, hypothesis.measurement)
            components.append(super().update(of_part, **kwargs))
            expected = of_part.measurement_prediction
            error = hypothesis.measurement.state_vector - expected.state_vector
            likelihood = multivariate_normal.logpdf(error.astype(float).ravel(), cov=expected.covar)
            # No outlier makes a model impossible.
            logs.append(likelihood + np.log(max(part.weight, 1e-300)))
        for component, weight in zip(components, softmax(logs), strict=True):
            component.weight = weight
        return GaussianMixtureUpdate(hypothesis=hypothesis, components=components)
