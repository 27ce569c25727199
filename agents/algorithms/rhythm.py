"""The agent that learns the habits of an object within the episode."""

from agents.algorithms.statements import StatementSettings, TrackAlgorithm
from agents.learned.rhythm_decider import RhythmDecider


class Rhythm(TrackAlgorithm):
    """A training run of the statement network on a beam of its own."""

    name = "rhythm"
    Settings = StatementSettings
    decider = RhythmDecider
