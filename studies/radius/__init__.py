"""Error of the estimated radius of a turn after a decision."""
