"""Deciders on recorded flights of aircraft: which mode, at every reported position."""
