"""Reading of small JSON and YAML files, whose size and numbers are bounded."""

import json
import math
from pathlib import Path
from typing import Any

import yaml

# Bytes.
LARGEST_FILE = 32 * 1024
# Exact as float64.
LARGEST_INTEGER = 2**53


def read_text(path: Path) -> str:
    """Read a file in UTF-8 of at most `LARGEST_FILE` bytes. Raises OSError or ValueError."""
    # A named pipe would wait for its writer.
    if not path.is_file():
        raise ValueError(f"{path.name} is missing or not a file")
    with path.open("rb") as file:
        content = file.read(LARGEST_FILE + 1)
    if len(content) > LARGEST_FILE:
        raise ValueError(f"{path.name} is larger than {LARGEST_FILE:,} bytes")
    return content.decode("utf-8")


def read_json(path: Path) -> Any:
    """Read JSON, as `read_text`; NaN, infinities and integers that float64 does not hold exactly
    are refused.
    """
    text = read_text(path)

    def real(digits: str) -> Any:
        return _checked(float(digits))

    def integer(digits: str) -> Any:
        return _checked(int(digits))

    try:
        return json.loads(text, parse_int=integer, parse_float=real, parse_constant=real)
    except RecursionError:
        raise ValueError(f"{path.name} is nested too deeply") from None


def parse_yaml(text: str) -> Any:
    """Parse YAML without aliases; numbers as in `read_json`, and none with colons. Raises
    ValueError.
    """
    try:
        return yaml.load(text, _Loader)
    except RecursionError:
        raise ValueError("nested too deeply") from None
    except (yaml.YAMLError, LookupError, AttributeError, ArithmeticError, TypeError) as error:
        # Those that are not of YAML come from tags such as !!bool x, and from escapes of large
        # numbers.
        raise ValueError(str(error) or "not YAML") from None


class _Loader(yaml.SafeLoader):
    """Refuses what YAML 1.1 alone takes for a number, and aliases: a few nested ones that are
    merged need hours.
    """

    def compose_node(self, parent: yaml.Node | None, index: int) -> yaml.Node | None:
        if self.check_event(yaml.AliasEvent):
            raise ValueError("aliases are not allowed")
        return super().compose_node(parent, index)

    def construct_number(self, node: yaml.ScalarNode) -> float:
        # Of base 60, such as 1:59:59.
        if ":" in str(node.value):
            raise ValueError("a number has colons: quote a time, or give it in seconds")
        is_whole = node.tag.endswith("int")
        read = self.construct_yaml_int if is_whole else self.construct_yaml_float
        return _checked(read(node))


for _kind in ("int", "float"):
    _Loader.add_constructor(f"tag:yaml.org,2002:{_kind}", _Loader.construct_number)


def _checked(number: Any) -> Any:
    if isinstance(number, int) and abs(number) > LARGEST_INTEGER:
        raise ValueError(f"an integer is larger than {LARGEST_INTEGER}")
    if not math.isfinite(number):
        raise ValueError("a number is not finite")
    return number
