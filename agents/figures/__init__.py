"""What the figures of all studies have in common. They are drawn from plain data, not from
results.
"""
