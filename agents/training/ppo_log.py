"""What Stable-Baselines3 logs, in the run folder: metrics as JSON lines, and TensorBoard events."""

import threading
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import numpy as np
from stable_baselines3.common.logger import KVWriter, TensorBoardOutputFormat
from torch.utils.tensorboard import SummaryWriter

from agents.training import run_folder
from hybrid_env.checks import reject


def plain_values(logged: Mapping[str, Any]) -> dict[str, Any]:
    """Return the numbers and texts among logged values, as plain values."""
    plain = {name: value.item() if isinstance(value, np.generic) else value for name, value in logged.items()}
    return {name: value for name, value in plain.items() if isinstance(value, (int, float, str))}


class MetricsWriter(KVWriter):
    """Logger output that appends to the metrics file of the run folder."""

    def __init__(self, folder: Path):
        self.folder = folder

    def write(
        self, key_values: dict[str, Any], key_excluded: dict[str, tuple[str, ...]], step: int = 0
    ) -> None:
        """Append the values of an update."""
        values = plain_values(key_values)
        values.pop("time/iterations", None)  # counted from the last start
        run_folder.append_metrics(self.folder, step, values)

    def close(self) -> None:
        """Do nothing; the file is closed after every line."""


class Events(TensorBoardOutputFormat):
    """TensorBoard events; those that a killed run wrote after its last checkpoint are hidden."""

    def __init__(self, folder: Path, steps: int):
        self.folder = folder
        self.writer = SummaryWriter(str(folder), purge_step=steps + 1)
        self._is_closed = False

    def write(
        self, key_values: dict[str, Any], key_excluded: dict[str, tuple[str, ...]], step: int = 0
    ) -> None:
        """Write the values of an update.

        Raises:
            ArgumentError: the file cannot be written.
        """
        try:
            super().write(key_values, key_excluded, step)
        except OSError as error:
            allowed = f"a folder that can be written ({error.strerror})"
            raise reject("run", str(self.folder), allowed) from None

    def close(self) -> None:
        """Close the file."""
        with suppress(OSError):  # every `write` flushes, so nothing is lost here
            super().close()


@contextmanager
def without_tracebacks_of_threads() -> Iterator[None]:
    """Context manager without the traceback that TensorBoard's thread prints if a file cannot be written.

    The error is raised again by the next `write`.
    """
    hook = threading.excepthook
    threading.excepthook = lambda error: None if issubclass(error.exc_type, OSError) else hook(error)
    try:
        yield
    finally:
        threading.excepthook = hook
