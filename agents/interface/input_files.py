"""YAML of plain values, whose numbers are bounded."""

from typing import Any

import yaml

from hybrid_env.json_files import bounded_number


def parse_yaml(text: str) -> Any:
    """Parse YAML without aliases; numbers as in `read_json`, and none with colons. Raises
    ValueError.
    """
    try:
        return yaml.load(text, _Loader)
    except RecursionError:
        raise ValueError("nested too deeply") from None
    except (yaml.YAMLError, LookupError, AttributeError, ArithmeticError, TypeError) as error:
        # Errors of other kinds come from tags such as !!bool x, and from escapes of large numbers.
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
        # A number of base 60, such as 1:59:59.
        if ":" in str(node.value):
            raise ValueError("a number has colons: quote a time, or give it in seconds")
        is_whole = node.tag.endswith("int")
        read = self.construct_yaml_int if is_whole else self.construct_yaml_float
        return bounded_number(read(node))


for _kind in ("int", "float"):
    _Loader.add_constructor(f"tag:yaml.org,2002:{_kind}", _Loader.construct_number)
