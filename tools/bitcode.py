"""Write the bitcode of the kernels of the registered ids into the package, see
`hybrid_env/core/bitcode.py`: `python -m tools.bitcode`.
"""

import os
import sys
from pathlib import Path

from hybrid_env.core import bitcode
from hybrid_env.core.compilation import config
from hybrid_env.core.kernels import kernel_of
from hybrid_env.core.memory import AnchorAwareBank, ImmBank, PublishedBank


def main(folder: Path) -> None:
    """Write the files of the present sources into a folder, and remove those of others."""
    # Settings of numba: for any processor, which optimises the code when it loads it.
    os.environ |= {"NUMBA_CPU_NAME": "generic", "NUMBA_CPU_FEATURES": "", "NUMBA_OPT": "0"}
    config.reload_config()
    for path in folder.glob("*.bc.xz"):
        path.unlink()
    for bank in (AnchorAwareBank, PublishedBank, ImmBank):
        bitcode.save(kernel_of(bank, live=False), folder)


if __name__ == "__main__":
    main(Path(sys.argv[1]) if sys.argv[1:] else bitcode.FOLDER)
