"""Kalman filters, their IMM and a smoother for many tracks at once, beside filterpy's.

All have the interface of `track_filter.TrackFilter`. `run_filter.run_filter` runs one over a
recording, and `smoother.smooth` its output backwards. Other studies use them too.
"""
