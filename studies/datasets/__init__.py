"""Episodes of deciders as data sets of Minari."""
