"""Files whose objects have two columns each, such as tables of players."""

import numpy as np
import pytest

TIMES = 0.04 * np.arange(60)
HEADER = ",,,Home,,Home,,Home,\n,,,11,,1,,2,\nPeriod,Frame,Time [s],Player11,,Player1,,Player2,\n"


def row(k, *cells):
    return ",".join(["1", str(k + 1), f"{TIMES[k]:.2f}", *cells]) + "\n"


def test_every_player_is_an_object(read):
    place = [f"{0.2 * k:.3f},{1.0 + 0.1 * k:.3f}" for k in range(60)]
    other = [f"{5.0 - 0.2 * k:.3f},{-0.1 * k:.3f}" for k in range(60)]
    content = HEADER + "".join(row(k, place[k], other[k], "NaN,NaN") for k in range(60))
    file = read(content)

    assert [each.name for each in file.recordings] == ["Player11", "Player1"]
    for recording, cells in zip(file.recordings, (place, other), strict=True):
        np.testing.assert_allclose(recording.times, TIMES, atol=1e-9)
        expected = [[float(number) for number in cell.split(",")] for cell in cells]
        np.testing.assert_allclose(recording.positions, expected, atol=1e-9)
    assert file.objects == 3
    assert file.warnings[0].startswith("Player2: ")
    # One of them by the option, as before.
    [one] = read(content, columns={"x": "6", "y": "7"}).recordings
    np.testing.assert_array_equal(one.positions, file.recordings[1].positions)


@pytest.mark.parametrize("header", ["t,x,y,note,,more,", "t,lat,lon,note,,more,"])
def test_columns_without_a_name_beside_positions_are_no_objects(read, header):
    rows = (f"{k},{0.001 * k},{0.002 * k},1,2,3,4" for k in range(30))

    assert len(read("\n".join([header, *rows, ""])).recordings) == 1
