"""Programs for developers. They are in the repository and in the source distribution, not in the
wheel.
"""
