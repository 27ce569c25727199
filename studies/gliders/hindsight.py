"""Rules that see whole flights of gliders, beside those that state the mode live."""

from dataclasses import replace

import numpy as np

from studies.flights.flight import TIERS, Flight
from studies.flights.hindsight import HindsightRule
from studies.flights.labels import window_sums
from studies.flights.rules import Settings, TurnRule, begun
from studies.flights.turns import LEFT, RIGHT, STRAIGHT, Batch, IntArray, TurnEstimates
from studies.gliders.rules import MODELS, ground_turns
from studies.gliders.simulated import decode_fast, turns_fast


def by_viterbi(batch: Batch, estimates: TurnEstimates, settings: Settings) -> IntArray:
    """State what the decoder of libigc says, as `decode_fast` has it, with the side to which the
    ground track turned in a time about each position [s].
    """
    stated = begun(batch, settings)
    turned = ground_turns(batch)[:, 1, :, 0]
    for piece, rows in enumerate(batch.present.T):
        times = batch.times[rows, piece]
        flight = Flight("", TIERS["A"], times, batch.positions[rows, piece])
        circling = decode_fast(turns_fast(flight)[:, None]) == 1
        for column, (window,) in enumerate(settings):
            side = np.where(window_sums(times, window, turned[rows, piece]) > 0.0, LEFT, RIGHT)
            stated[rows, piece, column] = np.where(circling[:, 0], side, STRAIGHT)
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
