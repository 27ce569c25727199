"""The league: one protocol for every decider, and the table of the results.

`protocol` plays a decider in all worlds and has its file, `table` shows many files, `families`
trains recipes.
"""
