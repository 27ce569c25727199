"""What is published besides the code: the paper, the workflows and the cards of shipped weights."""

import importlib.util
import re
from pathlib import Path

import pytest
import yaml

from agents.evaluation.registry import WEIGHTS

ROOT = Path(__file__).parents[1]
PAPER = (ROOT / "paper.md").read_text(encoding="utf-8")
_, HEAD, BODY = PAPER.split("---\n", 2)
WORKFLOWS = sorted((ROOT / ".github" / "workflows").glob("*.yml"))
HOSTS = {"download.pytorch.org"}


def test_the_paper_has_the_form_of_the_journal():
    head = yaml.safe_load(HEAD)
    assert {"title", "tags", "authors", "affiliations", "date", "bibliography"} <= set(head)
    sections = re.findall(r"^# (.*)$", BODY, re.MULTILINE)
    assert sections[:3] == ["Summary", "Statement of need", "State of the field"]
    assert sections[3:] == ["Software design", "Research impact statement", "References"]
    assert 750 <= len(BODY.split()) < 1000
    assert all((ROOT / path).is_file() for path in re.findall(r"!\[.*\]\((.*?)\)", BODY))


def test_references_of_the_paper_are_in_its_bibliography_and_the_other_way_round():
    entries = re.findall(
        r"^@\w+\{(\w+),$",
        (ROOT / "paper.bib").read_text(encoding="utf-8"),
        re.MULTILINE,
    )
    assert len(set(entries)) == len(entries)
    assert set(re.findall(r"@(\w+)", BODY)) == set(entries)
    labels = re.findall(r"\\label\{(\w+)\}", BODY)
    assert sorted(re.findall(r"\\autoref\{(\w+)\}", BODY)) == sorted(labels)


def test_figures_of_the_paper_are_those_of_the_readme():
    readme = (ROOT / "README.md").read_text(encoding="utf-8")
    table = [line for line in BODY.splitlines() if line.startswith("|")]

    assert len(table) == 7
    assert all(line in readme.splitlines() for line in table)
    words = " ".join(BODY.split()).partition("it earns ")[2].partition(". ")[0]
    numbers = re.findall(r"\d+\.\d+", words)
    assert len(numbers) == 11
    assert set(numbers) <= set(re.findall(r"\d+\.\d+", readme.partition("Over 18,000 segments")[2]))


@pytest.mark.parametrize("path", WORKFLOWS, ids=lambda path: path.name)
def test_workflows_run_targets_of_make_and_name_no_other_host(path):
    text = path.read_text(encoding="utf-8")
    jobs = yaml.safe_load(text)["jobs"]
    steps = [step for job in jobs.values() for step in job["steps"]]
    targets = re.findall(
        r"^(\w+):",
        (ROOT / "Makefile").read_text(encoding="utf-8"),
        re.MULTILINE,
    )
    commands = [step["run"].split() for step in steps if "run" in step]

    assert commands
    assert all(words[0] == "make" and words[1] in targets and len(words) == 2 for words in commands)
    used = [step["uses"] for step in steps if "uses" in step]
    assert all(re.fullmatch(r"(actions|pypa)/[\w-]+@[\w/]+", one) for one in used)
    assert set(re.findall(r"https?://([\w.]+)", text)) <= HOSTS


def test_a_release_is_uploaded_by_trusted_publishing():
    assert [path.name for path in WORKFLOWS] == ["ci.yml", "publish.yml"]
    text = WORKFLOWS[1].read_text(encoding="utf-8")
    job = yaml.safe_load(text)["jobs"]["publish"]
    assert job["permissions"] == {"id-token": "write"}
    assert job["steps"][-1]["uses"].startswith("pypa/gh-action-pypi-publish@")
    assert "secrets" not in text


@pytest.mark.parametrize(
    "folder",
    [str(folder.relative_to(WEIGHTS)) for folder in sorted(WEIGHTS.glob("*/*"))],
)
def test_the_site_has_a_card_of_every_set_of_weights(folder):
    spec = importlib.util.spec_from_file_location(
        "embedded_texts",
        ROOT / "docs/_ext/embedded_texts.py",
    )
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    page = (ROOT / "docs" / "models.md").read_text(encoding="utf-8")

    assert ("card", folder) in module.MARK.findall(page)
    card = module.card(folder)
    assert re.search(r"\| weights \| \d{1,2},\d{3} numbers, [3-8]\d,\d{3} bytes \|", card)
    assert yaml.safe_load(card.partition("```yaml\n")[2].removesuffix("```"))
