"""Learned deciders, their training, and the studies that compare them with the classical rules.

Of the subpackages `interface`, `figures`, `learned`, `evaluation` and `training` each imports only
those before it, and those of the commands (`studies`, `recordings`) all of them. `functions` has
the commands for Python, `cli` for the console.
"""

from hybrid_env.extras import lazy_names

__all__, __getattr__, __dir__ = lazy_names(__name__)
