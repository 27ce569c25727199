"""First seed of the episodes of each purpose, so that no episode serves two purposes."""

SELECTION = 1_000_000_000
"""Thresholds are selected on episodes from this seed on; reported episodes use smaller seeds."""

SELECTION_EPISODES = 1000
"""Number of episodes used to select a threshold."""

FITTING = 2_000_000_000
"""Stopping rules are fitted on episodes from this seed on."""

SEALED = 7_000_000_000
"""Paths of simulators from here on stay closed until agent and settings are fixed, see `agents.studies.seal`."""

STOPPING = 6_000_000_000
"""Deciders without a threshold select one on episodes of what they are told from this seed on."""

TRAINING = 10**12
"""Training episodes are seeded from here on, 10^9 apart for each training seed."""

LEARNING_CURVE = 3_000_000_000
"""Learning curves are evaluated on episodes from this seed on."""

DATASET = 5_000_000_000
"""Episodes of data sets for offline learning have seeds from here on."""

DRAWN_WORLDS = 4_000_000_000
"""Random worlds of evaluations are drawn with seeds from here on."""
