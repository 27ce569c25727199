"""Learned deciders, their training, and the commands.

Of the subpackages `interface`, `figures`, `learned`, `evaluation`, `training`, `recordings` and
`commands` each imports only those before it. `functions` has the commands for Python, `cli` for the
console.
"""

from hybrid_env.extras import lazy_names

__all__, __getattr__, __dir__ = lazy_names(__name__)
