"""Deciders on the same episodes: the plan, which does the work, and what was found."""
