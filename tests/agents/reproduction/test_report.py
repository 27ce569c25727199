import math

from agents.reproduction.command import to_markdown
from baselines.papers.reproduction import Cell, Reproduction


def test_a_table_without_published_values_has_our_intervals():
    cells = tuple(
        Cell("table", row, "error", math.nan, x, x - 0.1, x + 0.2, 1) for row, x in (("ATE", 2.0), ("IMM", 1.0))
    )
    text = to_markdown(Reproduction("Paper", 100, 0, cells, (), {}))
    assert "| ATE | 2.0 (1.9 to 2.2) |" in text
    assert "| IMM | 1.0 (0.9 to 1.2) |" in text
