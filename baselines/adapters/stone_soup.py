"""The IMM filter as predictor and updater of Stone Soup, and tracks of Stone Soup in a live
tracker.

The state of a track is a Gaussian mixture of Stone Soup: a component for each model of the filter,
whose weight is the probability of the model. Hypothesisers, data associators, initiators and
trackers use its mean and covariance.

    imm = IMMFilter([steady, manoeuvre], sojourns=5.0)
    predictor, updater = IMMPredictor(imm), IMMUpdater(imm, measurement_model)
    hypothesiser = DistanceHypothesiser(predictor, updater, Mahalanobis(), missed_distance=4)
"""

import copy
import datetime
from typing import Any

import numpy as np
from stonesoup.base import Property
from stonesoup.models.measurement.linear import LinearGaussian
from stonesoup.predictor import Predictor
from stonesoup.types.hypothesis import SingleHypothesis
from stonesoup.types.mixture import GaussianMixture
from stonesoup.types.multihypothesis import MultipleHypothesis
from stonesoup.types.prediction import GaussianMeasurementPrediction, Prediction
from stonesoup.types.state import GaussianState, StateMutableSequence, WeightedGaussianState
from stonesoup.types.track import Track
from stonesoup.types.update import GaussianMixtureUpdate, Update
from stonesoup.updater import Updater

from baselines.estimation.imm import IMMFilter, mixture
from baselines.rules.tracker import OnlineEstimate, OnlineTracker
from hybrid_env.checks import FloatArray, reject


class IMMPrediction(Prediction, GaussianMixture):
    """A predicted mixture: a component for each model, weighted by its probability."""


class IMMPredictor(Predictor):
    """The prediction of an IMM filter. A state that is no mixture, as that of an initiator, begins
    the models from its mean and covariance, with their stationary probabilities. After
    probabilistic association each model has the mixture of its hypotheses.
    """

    imm: IMMFilter = Property(doc="Filter; its models, not its estimates, are used")
    measurement_model: LinearGaussian = Property(
        default=None,
        doc="That of the updater; needed for hypotheses whose detections have none",
    )
    transition_model: Any = Property(default=None, doc="Not used: the filter has its own models")

    def predict(
        self,
        prior: Any,
        timestamp: datetime.datetime | None = None,
        **kwargs: Any,
    ) -> IMMPrediction:
        """Return the prediction of a track or state to a time; None predicts to its own."""
        state = prior[-1] if isinstance(prior, StateMutableSequence) else prior
        imm = _filter_of(self.imm, state, self.measurement_model)
        if timestamp is not None and state.timestamp is not None:
            imm.predict((timestamp - state.timestamp).total_seconds())
        return IMMPrediction(components=_components(imm, timestamp or state.timestamp), prior=state)


class IMMUpdater(Updater):
    """The correction of an IMM filter by measured positions."""

    imm: IMMFilter = Property(doc="Filter; its models, not its estimates, are used")
    measurement_model: LinearGaussian = Property(
        default=None,
        doc="Positions of the state and their covariance; None takes that of each detection",
    )

    def predict_measurement(
        self,
        predicted_state: GaussianState,
        measurement_model: LinearGaussian | None = None,
        measurement_noise: bool = True,
        **kwargs: Any,
    ) -> GaussianMeasurementPrediction:
        """Return the predicted position, and its covariance of the merged models."""
        model, order = self._check_measurement_model(measurement_model), self.imm.order
        cross = predicted_state.covar[:, ::order]
        spread = cross[::order] + (_noise(self.imm, model) if measurement_noise else 0.0)
        known = {"timestamp": predicted_state.timestamp, "cross_covar": cross}
        return GaussianMeasurementPrediction(predicted_state.mean[::order], spread, **known)

    def update(self, hypothesis: SingleHypothesis, **kwargs: Any) -> GaussianMixtureUpdate:
        """Return the prediction of a hypothesis, corrected by its measurement."""
        model = self._check_measurement_model(hypothesis.measurement.measurement_model)
        if hypothesis.measurement_prediction is None:
            hypothesis.measurement_prediction = self.predict_measurement(
                hypothesis.prediction,
                model,
            )
        components = _components(
            _corrected(self.imm, hypothesis, model),
            hypothesis.measurement.timestamp,
        )
        return GaussianMixtureUpdate(hypothesis=hypothesis, components=components)


def measured_position(state: Any) -> FloatArray | None:
    """Return the position, (d,) [m], that a state was updated with, most probably; None without
    a measurement.
    """
    hypothesis = state.hypothesis if isinstance(state, Update) else None
    if isinstance(hypothesis, MultipleHypothesis):
        hypothesis = max(hypothesis, key=lambda one: one.probability)
    if not hypothesis:
        return None
    return np.asarray(hypothesis.measurement.state_vector, np.float64).ravel()


def decide_track(track: Track, tracker: OnlineTracker) -> list[OnlineEstimate]:
    """Return what a live tracker, which begins anew, knows after each state of a track, at
    multiples of its tick.
    """
    tracker.begin()
    start = track[0].timestamp
    return [
        tracker.update(measured_position(state), (state.timestamp - start).total_seconds())
        for state in track
    ]


def _noise(imm: IMMFilter, model: LinearGaussian) -> FloatArray:
    """Return the covariance of a measurement, (d, d), of a model that measures the positions of
    a state.
    """
    positions = tuple(range(0, imm.axes * imm.order, imm.order))
    mapping = getattr(model, "mapping", model)
    if not isinstance(model, LinearGaussian) or tuple(mapping) != positions:
        raise reject("measurement_model", mapping, f"LinearGaussian with the mapping {positions}")
    return np.asarray(model.covar(), np.float64)


def _filter_of(imm: IMMFilter, state: Any, model: LinearGaussian | None = None) -> IMMFilter:
    """Return a filter with the models of another one, and the estimates of a state."""
    found = copy.deepcopy(imm)
    hypotheses = getattr(state, "hypothesis", None)
    if isinstance(state, GaussianMixture):
        found.begin_from_models(*_arrays(state))
    elif isinstance(hypotheses, MultipleHypothesis) and isinstance(
        hypotheses[0].prediction,
        GaussianMixture,
    ):
        found.begin_from_models(*_merged_hypotheses(imm, hypotheses, model))
    else:
        found.begin_from(np.asarray(state.mean, np.float64).T, np.asarray(state.covar, np.float64))
    return found


def _arrays(state: GaussianMixture) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return probabilities (1, M), states (1, M, n) and covariances (1, M, n, n) of a mixture."""
    weights = state.weights.astype(np.float64)
    means, covariances = np.asarray(state.means, np.float64), np.asarray(state.covars, np.float64)
    return weights[None] / weights.sum(), means.T[None], np.moveaxis(covariances, -1, 0)[None]


def _merged_hypotheses(
    imm: IMMFilter,
    hypotheses: MultipleHypothesis,
    model: LinearGaussian | None,
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the arrays of a mixture that has, for each model, the mixture over the hypotheses."""
    found = []
    for one in hypotheses:
        prediction = _arrays(one.prediction)
        if one:
            after = _corrected(imm, one, one.measurement.measurement_model or model)
            prediction = after.probabilities, *after.estimates
        found.append(prediction)
    weights, states, covariances = (
        np.concatenate(values).swapaxes(0, 1) for values in zip(*found, strict=True)
    )
    # (M, hypotheses)
    weights = weights * np.array([float(one.probability) for one in hypotheses])
    total = weights.sum(1)
    mean, covariance = mixture(states, covariances, (weights / total[:, None])[:, None])
    return total[None] / total.sum(), mean[None, :, 0], covariance[None, :, 0]


def _corrected(
    imm: IMMFilter,
    hypothesis: SingleHypothesis,
    model: LinearGaussian | None,
) -> IMMFilter:
    """Return the filter of a prediction after the measurement of a hypothesis."""
    found = _filter_of(imm, hypothesis.prediction)
    position = np.asarray(hypothesis.measurement.state_vector, np.float64).T
    found.update(position, None if model is None else _noise(imm, model))
    return found


def _components(imm: IMMFilter, timestamp: datetime.datetime | None) -> list[WeightedGaussianState]:
    """Return the components of a mixture: the estimates of the models."""
    states, covariances = imm.estimates
    return [
        WeightedGaussianState(state[:, None], covariance, timestamp=timestamp, weight=float(weight))
        for state, covariance, weight in zip(
            states[0],
            covariances[0],
            imm.probabilities[0],
            strict=True,
        )
    ]
