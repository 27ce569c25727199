"""One protocol for every decider, and rivals from the literature, trained by recipe."""
