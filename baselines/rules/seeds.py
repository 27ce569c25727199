"""First seed of the episodes of each purpose, so that no episode serves two purposes."""

SELECTION = 1_000_000_000  # thresholds are selected on episodes from here on; reported ones use smaller seeds
SELECTION_EPISODES = 1000  # to select a threshold on
FITTING = 2_000_000_000  # stopping rules are fitted
LEARNING_CURVE = 3_000_000_000  # learning curves are evaluated
DRAWN_WORLDS = 4_000_000_000  # random worlds of evaluations are drawn
DATASET = 5_000_000_000  # data sets for offline learning
CHOOSING = 6_000_000_000  # deciders without a threshold select one on episodes of what they are told
SEALED = 7_000_000_000  # paths of simulators stay closed until agent and settings are fixed, see `agents.studies.seal`
MEASURING = 8_000_000_000  # the law of the noise is measured
TRAINING = 10**12  # training, 10^9 apart for each training seed
