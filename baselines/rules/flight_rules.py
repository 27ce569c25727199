"""The rules on recorded flights: those for unknown switches, with other filters and thresholds."""

from baselines.rules.change_detection import CusumDecider
from baselines.rules.decider import FLIGHTS
from baselines.rules.threshold import ThresholdDecider


class FlightThresholdDecider(ThresholdDecider):
    """The threshold on the probabilities of the IMM filter over turn rates."""

    name, task = "imm", FLIGHTS


class FlightBeamDecider(FlightThresholdDecider):
    """The threshold on the semi-Markov posterior over turn rates, in which short turns are unlikely."""

    name, title = "beam", "beam"


class FlightCusumDecider(CusumDecider):
    """CUSUM of the likelihoods of the modes in the IMM filter over turn rates."""

    name, task = "cusum", FLIGHTS
    default = 3.5
