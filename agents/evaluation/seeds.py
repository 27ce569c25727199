"""Where the episodes of each purpose begin, so that none is used for two."""

SELECTION = 1_000_000_000
"""Thresholds are chosen on episodes from this seed on; those reported count from small seeds."""

SELECTION_EPISODES = 1000
"""As many are used to choose a threshold."""

FITTING = 2_000_000_000
"""Stopping rules are fitted on episodes from this seed on."""

TRAINING = 10**12
"""Tracks of a training are seeded from here on, 10^9 apart for each training seed."""

LEARNING = 3_000_000_000
"""A training is measured on its way on episodes from this seed on."""
