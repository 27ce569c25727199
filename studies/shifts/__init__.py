"""Deciders in other environments than the nominal one: shifted, noisy and random ones."""
