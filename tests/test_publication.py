"""What is published besides the code: the paper, the workflows and the cards of shipped weights."""

import json
import re
import subprocess
import sys
from pathlib import Path

import yaml

from agents.evaluation.registry import WEIGHTS

ROOT = Path(__file__).parents[1]
README, PAPER, BIBLIOGRAPHY, MAKEFILE, CARDS = (
    (ROOT / name).read_text(encoding="utf-8")
    for name in ("README.md", "paper.md", "paper.bib", "Makefile", "docs/agents.md")
)
BODY = PAPER.split("---\n", 2)[2]


def test_the_paper_has_its_references_and_the_length_that_the_journal_allows():
    assert 750 <= len(BODY.split()) < 1000
    assert all((ROOT / path).is_file() for path in re.findall(r"!\[.*\]\((.*?)\)", BODY))
    entries = re.findall(r"^@\w+\{(\w+),$", BIBLIOGRAPHY, re.MULTILINE)
    assert sorted(set(re.findall(r"@(\w+)", BODY))) == sorted(entries)


def test_the_table_of_the_paper_is_that_of_the_readme():
    table = [line for line in BODY.splitlines() if line.startswith("|")]

    assert len(table) == 9
    assert set(table) <= set(README.splitlines())


def test_workflows_run_targets_of_make_and_publish_without_a_secret():
    targets = re.findall(r"^(\w+):", MAKEFILE, re.MULTILINE)
    texts = {
        path.name: path.read_text(encoding="utf-8")
        for path in (ROOT / ".github" / "workflows").glob("*.yml")
    }
    assert set(texts) == {"ci.yml", "publish.yml"}
    for text in texts.values():
        jobs = yaml.safe_load(text)["jobs"]
        for step in (step for job in jobs.values() for step in job["steps"]):
            make, target = step.get("run", "make test").split()
            assert make == "make"
            assert target in targets
            assert re.fullmatch(r"(actions|pypa)/[\w-]+@[\w/]+", step.get("uses", "actions/a@v1"))
        assert set(re.findall(r"https?://([\w.]+)", text)) <= {"download.pytorch.org"}
        assert "secrets" not in text
    job = yaml.safe_load(texts["publish.yml"])["jobs"]["publish"]
    assert job["permissions"] == {"id-token": "write"}
    assert job["steps"][-1]["uses"].startswith("pypa/gh-action-pypi-publish@")


def test_the_page_of_the_agents_has_the_card_of_every_set_of_weights():
    rows = re.findall(r"^\| `\w+` \| .*\(\.\./(agents/.*/policy\.json)\) \|$", CARDS, re.MULTILINE)
    cards = [path.relative_to(ROOT) for path in WEIGHTS.glob("*/*/policy.json")]

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
