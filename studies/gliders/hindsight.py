"""Rules that see whole flights of gliders, beside those that state the mode live."""

from dataclasses import replace

import numpy as np

from studies.flights.flight import Flight, Tier
from studies.flights.hindsight import HindsightRule
from studies.flights.labels import window_sums
from studies.flights.rules import Settings, TurnRule, begun
from studies.flights.turns import LEFT, RIGHT, STRAIGHT, Batch, IntArray, TurnEstimates
from studies.gliders.circling import air_motion
from studies.gliders.rules import MODELS
from studies.gliders.simulated import decode_fast, turns_fast


def by_viterbi(batch: Batch, estimates: TurnEstimates, settings: Settings) -> IntArray:
    """State what the decoder of libigc says, as `decode_fast` has it, with the side of the mean
    turn rate of rule a in a time about each position [s].
    """
    stated = begun(batch, settings)
    flights = [
        Flight("", Tier("", across, timing), batch.times[rows, piece], batch.positions[rows, piece])
        for piece, (rows, across, timing) in enumerate(
            zip(batch.present.T, batch.across.tolist(), batch.timing.tolist(), strict=True)
        )
    ]
    for piece, (flight, motion) in enumerate(zip(flights, air_motion(flights), strict=True)):
        circling = decode_fast(turns_fast(flight)[:, None])[:, 0] == 1
        for column, (window,) in enumerate(settings):
            side = np.where(window_sums(flight.times, window, motion.rates) > 0.0, LEFT, RIGHT)
            states = np.where(circling, side, STRAIGHT)
            stated[: len(states), piece, column] = states
    return stated


HINDSIGHT = {
    "hindsight": HindsightRule(
        models=tuple(replace(MODELS[3], acceleration=acceleration) for acceleration in (3, 6)),
        radii=False,
    ),
    "libigc": TurnRule(state=by_viterbi, grid=((20.0,),)),
}
"""Rules by name. The first selects from two densities of the acceleration; wind changes the
radius of a turn over ground, and so its modes have turn rates.
"""
