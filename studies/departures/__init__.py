"""What deciders lose that are not told how the world departs from their model."""
