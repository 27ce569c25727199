"""What is published besides the code: the paper and the cards of shipped weights."""

import json
import re
import subprocess
import sys
from pathlib import Path

from agents.evaluation.registry import SHIPPED

ROOT = Path(__file__).parents[1]
PUBLISHED, PAPER, BIBLIOGRAPHY, CARDS = (
    (ROOT / name).read_text(encoding="utf-8")
    for name in ("docs/environments/published.md", "paper.md", "paper.bib", "docs/agents.md")
)
BODY = PAPER.split("---\n", 2)[2]


def test_the_paper_has_its_references():
    assert all((ROOT / path).is_file() for path in re.findall(r"!\[.*\]\((.*?)\)", BODY))
    entries = re.findall(r"^@\w+\{(\w+),$", BIBLIOGRAPHY, re.MULTILINE)
    assert sorted(set(re.findall(r"@(\w+)", BODY))) == sorted(entries)


def test_the_table_of_the_paper_is_that_of_the_published_ids():
    table = [line for line in BODY.splitlines() if line.startswith("|")]

    assert len(table) == 9
    assert set(table) <= set(PUBLISHED.splitlines())


def test_the_page_of_the_agents_has_the_card_of_every_set_of_weights():
    rows = re.findall(r"^\| `\w+` \| .*\(\.\./(agents/.*/policy\.json)\) \|$", CARDS, re.MULTILINE)
    cards = [path.relative_to(ROOT) for path in SHIPPED.glob("*/*/policy.json")]

    assert sorted(rows) == sorted(map(str, cards))
    for path in rows:
        card = json.loads((ROOT / path).read_text(encoding="utf-8"))
        told = f"| `{card['recipe']['name']}` | {card['steps']:,} | [policy.json](../{path}) |"
        assert told in CARDS
        assert (ROOT / path).with_suffix(".safetensors").stat().st_size < 90_000


def test_examples_of_the_site_start_a_study_as_a_process():
    code = (
        f"import runpy, subprocess, sys; runpy.run_path({str(ROOT / 'docs/conf.py')!r});"
        "subprocess.run([sys.executable, '-m', 'studies'], check=True)"
    )
    # Where the gallery runs the examples.
    folder = ROOT / "docs/examples"
    ran = subprocess.run([sys.executable, "-c", code], cwd=folder, capture_output=True, text=True)

    assert ran.returncode == 0, ran.stderr
    assert "datasets" in ran.stdout
