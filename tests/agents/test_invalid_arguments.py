"""The command line: an invalid value is refused in one line, and nothing is written."""

import shlex

import pytest

from agents.cli import main

INVALID_ARGUMENTS = [
    ("", "Expected one of"),
    ("compar", "did you mean 'compare'?"),
    ("train --tua 3", "did you mean '--tau'"),
    ("train --recipe pppo", "did you mean 'ppo'?"),
    ("train --set n_env=3", "did you mean 'n_envs'"),
    ("train --env HybridTrak-v0", "did you mean 'HybridTrack-v0'"),
    ("compare ate oracle", "did you mean 'msprt-oracle'?"),
    ("compare aet shipped", "decider='aet' does not exist: did you mean 'ate'?"),
    ("compare msprt:0.1", "without a threshold"),
    ("evaluate shipped2", "did you mean 'shipped'?"),
    ("compare --decider ate", "flag='--decider' does not exist: its values stand without a flag"),
    ("evaluate xyz", "decider='xyz' does not exist: expected a rule"),
    ("evaluate beam", "a decider for announced switches, not unknown ones"),
    ("evaluate ate:abc", "expected after the colon a number, 'auto', or a rate such as '2%'"),
    ("evaluate model.zip", "expected a file that exists"),
    ("play msprtt --env HybridTrackPublished-v0", "did you mean 'msprt'"),
    ("compare --out bad.txt", "out="),
    ("train --set n_envs=[", "set='n_envs=['"),
    ("play --out no/x.gif", "out='no/x.gif'"),
    ("track nofile.csv", "file='nofile.csv'"),
    ("track good.csv --columns x=z y=y", "columns='z'"),
    ("track text.csv --bad-rows refuse", "line 3: rows whose position cannot be read"),
    ("track good.csv ./good.csv", "output folders of different names"),
    ("score good.csv good.csv", "no columns mode (its columns are x, y)"),
]


@pytest.mark.parametrize(("line", "message"), INVALID_ARGUMENTS)
def test_invalid_arguments_are_refused_with_one_line_and_exit_code_2(
    line, message, capsys, tmp_path, monkeypatch
):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "bad.txt").write_bytes(b"\x00\x01not a table")
    (tmp_path / "good.csv").write_text("x,y\n0,0\n1,1\n")
    (tmp_path / "text.csv").write_text("t,x,y\n0,1,2\n1,east,3\n2,3,4\n")
    before = sorted(tmp_path.rglob("*"))

    assert main(shlex.split(line)) == 2
    captured = capsys.readouterr()
    # Progress, and what is compiled the first time.
    others = ("Loading", "0:00:", "HybridTrack: compiling")
    lines = [line for line in captured.err.splitlines() if not line.startswith(others)]
    assert len(lines) == 1
    assert lines[0].startswith("hybridtrack: ")
    assert message in lines[0]
    assert captured.out == ""
    assert sorted(tmp_path.rglob("*")) == before
