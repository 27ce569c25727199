"""The banks of filters, and the scalar formulas of their filters."""
