"""Radar tracks of flights as a data set, filters on it, and the tables of a thesis about it."""
