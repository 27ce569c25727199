"""Mode decisions on recordings of positions: `hybridtrack track`, and the same as a function."""
