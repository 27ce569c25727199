"""Speed compared with common programs: `python -m tools.bench`.

`environments`, `filters`, `growth` and `programs` have the groups of measurements, which `__main__`
lists. `timing` measures two functions in turn and writes the table.
"""
