"""Training of the agents whose weights come with the package."""
