"""First seed of the episodes of each purpose, so that no episode serves two purposes."""

# Thresholds are selected on episodes from here on; reported ones use smaller seeds.
SELECTION = 1_000_000_000
# To select a threshold on.
SELECTION_EPISODES = 1000
# 2_000_000_000: free.
# Learning curves are evaluated.
LEARNING_CURVE = 3_000_000_000
# 4_000_000_000: random worlds of a study.
# 5_000_000_000: data sets for offline learning.
# Deciders without a threshold select one.
CHOOSING = 6_000_000_000
# 7_000_000_000: paths of simulators that were closed until agent and settings were fixed.
# Training, 10^9 apart for each training seed.
TRAINING = 10**12
