"""The interacting multiple model (IMM) bank: filters that run on over switches at unknown moments.
Blom & Bar-Shalom 1988, "The interacting multiple model algorithm for systems with Markovian
switching coefficients".

Each of M hypotheses has a Kalman filter of a coordinated turn and a probability, whose logarithm is
stored, so that none is lost in an outlier. The mode is a Markov chain whose transition matrix has 1
- hazard on the diagonal and hazard / (M - 1) elsewhere. A tick has three steps:

1. Mixing. The mode before the tick, given the mode h in the tick, is h with the probability w and
   otherwise distributed as without this knowledge. Filter h therefore starts from a normal
   distribution with mean and covariance of a mixture of two terms: its own estimate, with weight w,
   and the merged estimate of all filters.
2. Every filter predicts, is corrected by the measurement, and gives its log-likelihood.
3. Mean and covariance of the mixture of all filters are the merged estimate.

In every tick of a coordinated turn the object turns by the angle a = speed * tau / radius about the
centre that follows from its velocity: Golubkov 2018, eq. (1), with the switch at the present tick.
Its filter therefore needs no anchor. The angle follows from the estimated velocity and is then
treated as known, because the turn rate of the object does not change with the process noise of a
segment. The state is [x, vx, y, vy], with the suffixes x, u, y and v below; a covariance is its
upper triangle row by row, 10 numbers. A filter that diverges keeps its initial condition and
becomes unlikely, so that no NaN occurs.
"""

import math
from typing import Any

import numpy as np

from hybrid_env.core.banks.bank import estimate_of, set_estimate, signed_radius
from hybrid_env.core.banks.kalman import weigh
from hybrid_env.core.banks.mixture import NEGLIGIBLE, merge, normalize
from hybrid_env.core.banks.sensing import DIVERGED, LARGEST, correct_by_sensors
from hybrid_env.core.compilation import formula, inlined, internal
from hybrid_env.core.elementary import exp, log, sine_cosine
from hybrid_env.core.memory import (
    FloatArray,
    ImmBank,
    Records,
    State,
    Triangle4,
    state_of,
    triangle_of,
    write_lane,
)
from hybrid_env.core.motion import LARGEST_ANGLE
from hybrid_env.core.vectors import choose, combination, minus_square, widened


@inlined
def turn_coefficients(angle: float, tau: float) -> State:
    """Return (C, S, along, across) of a turn by an angle a in a tick of length tau: the new
    velocity is (C u - S v, S u + C v), with C = cos a and S = sin a; the position changes by (along
    u - across v, across u + along v), with along = tau sin(a) / a, across = tau (1 - cos a) / a
    [s].
    """
    half = 0.5 * angle
    sine, cosine = sine_cosine(half)
    quotient = sine / half if half != 0.0 else 1.0
    # Half angles avoid the cancellation of 1 - cos a.
    return (
        1.0 - 2.0 * sine * sine,
        2.0 * sine * cosine,
        tau * quotient * cosine,
        tau * quotient * sine,
    )


@inlined
def predict_covariance(p: Triangle4, turn: State, model: Any) -> Triangle4:
    """Return the predicted covariance F P F' + Q of a `FilterModel`, F the transition matrix; turn:
    from `turn_coefficients`.
    """
    xx, xu, xy, xv, uu, uy, uv, yy, yv, vv = p
    C, S, along, across = turn
    Q, drift = model.process_variance, model.drift_variance
    # Covariance of the new position with the old velocity.
    x_u = xu + along * uu - across * uv
    x_v = xv + along * uv - across * vv
    y_u = uy + across * uu + along * uv
    y_v = yv + across * uv + along * vv
    # Covariance of the new velocity with the old one.
    u_u = C * uu - S * uv
    u_v = C * uv - S * vv
    v_u = S * uu + C * uv
    v_v = S * uv + C * vv
    return (
        xx + along * (x_u + xu) - across * (x_v + xv) + drift,
        C * x_u - S * x_v,
        xy + across * x_u + along * x_v + along * uy - across * yv,
        S * x_u + C * x_v,
        C * u_u - S * u_v + Q,
        C * y_u - S * y_v,
        S * u_u + C * u_v,
        yy + across * (y_u + uy) + along * (y_v + yv) + drift,
        S * y_u + C * y_v,
        S * v_u + C * v_v + Q,
    )


@formula
def condition_x(p: Triangle4, inverse: float, variance: float) -> Triangle4:
    """Return the corrected covariance P - K H P after a measurement of x with variance R. inverse:
    1 / innovation variance [1/m^2].
    """
    xx, xu, xy, xv, uu, uy, uv, yy, yv, vv = p
    # The row of the measured coordinate is K R, which avoids cancellation.
    left = variance * inverse
    gain_u = xu * inverse
    gain_y = xy * inverse
    gain_v = xv * inverse
    # Variances are bounded below, so that rounding does not make them negative.
    return (
        xx * left,
        xu * left,
        xy * left,
        xv * left,
        max(uu - gain_u * xu, gain_u * gain_u * variance),
        uy - gain_u * xy,
        uv - gain_u * xv,
        max(yy - gain_y * xy, gain_y * gain_y * variance),
        yv - gain_y * xv,
        max(vv - gain_v * xv, gain_v * gain_v * variance),
    )


@inlined
def exchange_axes(p: Triangle4) -> Triangle4:
    """Return the covariance of [y, vy, x, vx]."""
    xx, xu, xy, xv, uu, uy, uv, yy, yv, vv = p
    return yy, yv, xy, uy, vv, xv, uv, xx, xu, uu


@internal
def begin_imm(bank: ImmBank, block: Any, lane: int, known: int) -> None:
    """Start every filter of a lane from the merged estimate of the block. known: the mode before
    the first tick; -1 if it is not known, all equally probable.
    """
    for h in range(bank.hypotheses.size):
        kalman = bank.hypotheses[h]
        set_estimate(kalman, lane, state_of(block.estimate, lane))
        write_lane(kalman.covariance, lane, triangle_of(block.covariance, lane))
        if known < 0:
            kalman.log_probability[lane] = -math.log(bank.hypotheses.size)
        else:
            kalman.log_probability[lane] = 0.0 if h == known else NEGLIGIBLE
        kalman.log_likelihood[lane] = 0.0


@formula
def _covariance(kalman: Any, lane: int) -> Triangle4:
    """Return the covariance of a filter."""
    return triangle_of(kalman.covariance, lane)


@formula
def mix(kalman: Any, block: Any, lane: int, model: Any) -> tuple[float, State, Triangle4]:
    """Return the prior probability of a mode in the tick, and its mixed initial condition."""
    probability = exp(max(kalman.log_probability[lane], NEGLIGIBLE))
    from_itself = (model.stay_probability - model.switch_probability) * probability
    prior = from_itself + model.switch_probability
    weight = from_itself / prior
    rest = 1.0 - weight
    merged = state_of(block.estimate, lane)
    estimate = kalman.x[lane], kalman.vx[lane], kalman.y[lane], kalman.vy[lane]
    difference = combination((1.0, -1.0), (estimate, merged))
    mean = combination((1.0, weight), (merged, difference))
    # The covariance of a mixture of two normal distributions.
    covariances = _covariance(kalman, lane), triangle_of(block.covariance, lane)
    within = combination((weight, rest), covariances)
    return prior, mean, minus_square(within, difference, -(weight * rest))


@formula
def predict(mean: State, mixed: Triangle4, curvature: float, model: Any) -> tuple[State, Triangle4]:
    """Return the predicted estimate of a filter and its covariance; curvature: 1 / radius,
    positive to the left.
    """
    x, u, y, v = mean
    angle = curvature * math.sqrt(u * u + v * v) * model.tau
    turn = turn_coefficients(max(min(angle, LARGEST_ANGLE), -LARGEST_ANGLE), model.tau)
    C, S, along, across = turn
    predicted = predict_covariance(widened(mixed), turn, model)
    new_x = x + along * u - across * v
    new_y = y + across * u + along * v
    return (new_x, C * u - S * v, new_y, S * u + C * v), widened(predicted)


@internal
def _step_hypothesis(
    kalman: Any, innovation: Any, block: Any, first: int, last: int, curvature: float, model: Any
) -> None:
    """Mix, predict and correct one filter of lanes first .. last - 1, without normalizing its
    probability.
    """
    variance_x, variance_y = model.variance_x, model.variance_y
    for lane in range(first, last):
        prior, mean, mixed = mix(kalman, block, lane, model)
        moved, predicted = predict(mean, mixed, curvature, model)
        # Sequential corrections by x and y; the product of both densities is the joint density.
        sigma_x = predicted[0] + variance_x
        inverse_x = 1.0 / sigma_x
        innovation_x = block.measurement[0, lane] - moved[0]
        gain_x = innovation_x * inverse_x
        after_x = exchange_axes(condition_x(predicted, inverse_x, variance_x))
        sigma_y = after_x[0] + variance_y
        inverse_y = 1.0 / sigma_y
        innovation_y = block.measurement[1, lane] - (moved[2] + predicted[2] * gain_x)
        gain_y = innovation_y * inverse_y
        corrected = exchange_axes(condition_x(after_x, inverse_y, variance_y))
        white_x = innovation_x * math.sqrt(inverse_x)
        white_y = innovation_y * math.sqrt(inverse_y)
        log_variance = 0.5 * (log(sigma_x) + log(sigma_y))

        # These comparisons are False for NaN and for values that would lead to NaN.
        valid = (
            (sigma_x + sigma_y < LARGEST * LARGEST)
            & (predicted[4] + predicted[9] < LARGEST * LARGEST)
            & (abs(innovation_x) + abs(innovation_y) + abs(moved[1]) + abs(moved[3]) < LARGEST)
        )
        weight, likelihood = weigh(white_x, white_y, log_variance, model.freedom)
        factors = 1.0, weight * gain_x, weight * gain_y
        estimate = combination(factors, (moved, predicted[:4], after_x[2:4] + after_x[:2]))
        set_estimate(kalman, lane, choose(valid, estimate, mean))
        write_lane(kalman.covariance, lane, choose(valid, corrected, mixed))
        likelihood = likelihood if valid else -DIVERGED
        innovation.white_x[lane] = white_x if valid else 0.0
        innovation.white_y[lane] = white_y if valid else 0.0
        innovation.log_variance[lane] = log_variance if valid else 0.0
        kalman.log_likelihood[lane] = likelihood
        kalman.log_probability[lane] = log(prior) + likelihood


@inlined
def _curvature(hypothesis: int, radii: FloatArray) -> float:
    """Return the curvature of a hypothesis [1/m], positive to the left."""
    radius = signed_radius(hypothesis, radii)
    return 0.0 if radius == 0.0 else 1.0 / radius


@internal
def step_imm(
    bank: ImmBank, block: Any, first: int, last: int, radii: FloatArray, model: Any
) -> None:
    """Advance every filter, its probability and the merged estimate of lanes first .. last - 1 by
    one tick. block: with `measurement`, (2, LANES), and `estimate` and `covariance` of the merged
    estimate.
    """
    for h in range(bank.hypotheses.size):
        kalman = bank.hypotheses[h]
        innovation = bank.innovations[h]
        _step_hypothesis(kalman, innovation, block, first, last, _curvature(h, radii), model)
    normalize(bank, first, last)
    merge(bank, block, first, last, _covariance)


@internal
def sense_imm(
    bank: ImmBank, block: Any, lane: int, radii: FloatArray, sensors: Records, model: Any
) -> None:
    """Advance every filter of a lane by one tick without a measurement, or by all that the sensors
    measure, see `sensing`. Without one the probabilities follow the Markov chain, and innovations
    are zero, with the variance of a measurement.
    """
    first, last = np.uint64(lane), np.uint64(lane + 1)
    for h in range(bank.hypotheses.size):
        kalman = bank.hypotheses[h]
        innovation = bank.innovations[h]
        prior, mean, mixed = mix(kalman, block, lane, model)
        moved, predicted = predict(mean, mixed, _curvature(h, radii), model)
        finite = (predicted[0] + predicted[7] < LARGEST * LARGEST) & (
            predicted[4] + predicted[9] < LARGEST * LARGEST
        )
        # Also False for NaN.
        finite &= abs(moved[1]) + abs(moved[3]) < LARGEST
        set_estimate(kalman, lane, moved if finite else mean)
        write_lane(kalman.covariance, lane, predicted if finite else mixed)
        sigma_x = kalman.covariance[0, lane] + model.variance_x
        sigma_y = kalman.covariance[7, lane] + model.variance_y
        innovation.white_x[lane] = innovation.white_y[lane] = 0.0
        innovation.log_variance[lane] = 0.5 * (log(sigma_x) + log(sigma_y))
        kalman.log_likelihood[lane] = 0.0
        kalman.log_probability[lane] = log(prior)
    normalize(bank, first, last)
    measures = not math.isnan(block.measurement[0, lane])
    for h in range(bank.hypotheses.size if measures else 0):
        kalman = bank.hypotheses[h]
        innovation = bank.innovations[h]
        state, p = estimate_of(bank.hypotheses, h, lane), triangle_of(kalman.covariance, lane)
        corrected, q, measured, valid = correct_by_sensors(state, p, block, lane, sensors, model)
        set_estimate(kalman, lane, corrected)
        write_lane(kalman.covariance, lane, q)
        innovation.white_x[lane], innovation.white_y[lane] = measured[0], measured[1]
        innovation.log_variance[lane] = measured[2]
        likelihood = measured[3] if valid else -DIVERGED
        kalman.log_likelihood[lane] = likelihood
        kalman.log_probability[lane] += likelihood
    if measures:
        normalize(bank, first, last)
    merge(bank, block, first, last, _covariance)
