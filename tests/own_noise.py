"""Laws as users write them: that of the page, and one that pickle can find."""

import math
import re
from dataclasses import dataclass
from pathlib import Path

from hybrid_env import OwnNoise

PAGE = Path(__file__).parents[1] / "docs/environments/index.md"


@dataclass(frozen=True)
class Rounded(OwnNoise):
    """Normal errors, rounded to multiples of a step."""

    step: float = 0.5

    def draw(self, u):
        """Return both errors. Box & Muller 1958."""
        radius = math.sqrt(-2.0 * math.log(1.0 - u[0]))
        x = radius * math.cos(2.0 * math.pi * u[1])
        y = radius * math.sin(2.0 * math.pi * u[1])
        return self.step * round(x / self.step), self.step * round(y / self.step)


def run_page():
    """Run the Python programs of the page, one after another, and return their names."""
    names = {}
    programs = re.findall(r"```python\n(.*?)```", PAGE.read_text("utf-8"), re.DOTALL)
    for program in programs:
        exec(program, names)
    return names
