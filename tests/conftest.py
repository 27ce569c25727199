"""Commands that get no `--jobs` run in the process of the test, as on a machine with one core."""

import os

os.environ["LOKY_MAX_CPU_COUNT"] = "1"
