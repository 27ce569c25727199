"""Reading of small JSON files, whose size and numbers are bounded."""

import json
import math
from pathlib import Path
from typing import Any


def read_text(path: Path, largest: int = 32 * 1024) -> str:
    """Read a file in UTF-8 of at most `largest` bytes. Raises OSError or ValueError."""
    # A named pipe would wait for its writer.
    if not path.is_file():
        raise ValueError(f"{path.name} is missing or not a file")
    with path.open("rb") as file:
        content = file.read(largest + 1)
    if len(content) > largest:
        raise ValueError(f"{path.name} is larger than {largest:,} bytes")
    return content.decode("utf-8")


def read_json(path: Path, largest: int = 32 * 1024) -> Any:
    """Read JSON, as `read_text`; NaN, infinities and integers that float64 does not hold exactly
    are refused.
    """
    text = read_text(path, largest)

    def real(digits: str) -> Any:
        return bounded_number(float(digits))

    def integer(digits: str) -> Any:
        return bounded_number(int(digits))

    try:
        return json.loads(text, parse_int=integer, parse_float=real, parse_constant=real)
    except RecursionError:
        raise ValueError(f"{path.name} is nested too deeply") from None


def bounded_number(number: Any) -> Any:
    """Return a finite number; `ValueError` for others, and for integers that are too large."""
    # Exact as float64.
    if isinstance(number, int) and abs(number) > 2**53:
        raise ValueError(f"an integer is larger than {2**53}")
    if not math.isfinite(number):
        raise ValueError("a number is not finite")
    return number
