"""Messages name the cause, and their advice works when it is followed."""

import re
import shlex

import numpy as np
import pandas as pd
import pytest
from recorded_tracks import directions

from agents.cli import main

ROWS = 300
T = np.arange(float(ROWS))
HEADING = np.cumsum(np.where(T // 50 % 2 == 0, 0.0, 0.1))
PATH = np.cumsum(10.0 * directions(HEADING), axis=0)
X, Y = (PATH + np.random.default_rng(3).normal(size=PATH.shape)).T
PLANE = {"time": T, "x": X, "y": Y}
DEGREES = {"time": T, "x": 9.3 + 13e-6 * X, "y": 47.3 + 9e-6 * Y}
STRAIGHT = {"time": T, "x": 3.0 * T, "y": 1.0 * T}
TWO = pd.concat(
    [pd.DataFrame(PLANE).assign(who="a"), pd.DataFrame(PLANE).assign(who="b", x=X + 5e3)]
)
TWO = TWO.sort_values("time", kind="stable").assign(time=np.arange(2.0 * ROWS))
RANGES = {"time": T, "range": (np.hypot(X + 900.0, Y) / 90.0).round() * 90.0, "azimuth": T // 30}


@pytest.mark.parametrize(
    ("columns", "options", "cause", "advice"),
    [
        (DEGREES, "", "x and y of drive look like degrees", "--unit deg"),
        (TWO, "", "rows alternate .* two objects", "--object who"),
        ({"t": T, "u": X, "v": Y}, "", "no columns x and y", "--columns time=1 x=2 y=3"),
        (RANGES, "", "deviations are not seen", "--radar '30 0.01'"),
        (PLANE, "--radii 1e-4", "more than half a turn of radius 0.0001", ""),
        (PLANE, "--radii 1", "radius 1 do not explain the recording", "--radii (found)"),
        (
            PLANE,
            "--measurement-variance 100",
            "times what R says",
            "--measurement-variance (found)",
        ),
        (
            STRAIGHT,
            "--measurement-variance 1e-20",
            "the positions have no noise",
            "--measurement-variance (found)",
        ),
    ],
)
def test_advice_is_followed(tmp_path, capsys, columns, options, cause, advice):
    path = tmp_path / "drive.csv"
    pd.DataFrame(columns).to_csv(path, index=False)
    command = ["track", str(path), "--no-png", "--overwrite"]
    code = main([*command, *shlex.split(options)])
    captured = capsys.readouterr()
    said = " ".join((captured.out + captured.err).split())

    assert re.search(cause, said)
    assert "check units" not in said
    option = advice.split(" (found)")[0]
    assert option.split(" ")[0] in said
    if "(found)" in advice:
        # The message names the value.
        value = re.search(rf"([\d.]+) does: give it by {option}|{option} ([\d.e-]+)", said)
        advice = f"{option} {value[1] or value[2]}"
    assert code in (0, 2)
    assert main([*command, *shlex.split(advice)]) == 0
    captured = capsys.readouterr()
    assert not re.search(cause, " ".join((captured.out + captured.err).split()))
