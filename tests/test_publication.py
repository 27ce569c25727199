"""What is published besides the code: the paper, the workflows and the cards of shipped weights."""

import importlib.util
import re
from pathlib import Path

import yaml

from agents.evaluation.registry import WEIGHTS

ROOT = Path(__file__).parents[1]
README, PAPER, BIBLIOGRAPHY, MAKEFILE, CARDS = (
    (ROOT / name).read_text(encoding="utf-8")
    for name in ("README.md", "paper.md", "paper.bib", "Makefile", "docs/models.md")
)
BODY = PAPER.split("---\n", 2)[2]


def test_the_paper_has_its_references_and_the_length_that_the_journal_allows():
    assert 750 <= len(BODY.split()) < 1000
    assert all((ROOT / path).is_file() for path in re.findall(r"!\[.*\]\((.*?)\)", BODY))
    entries = re.findall(
        r"^@\w+\{(\w+),$",
        BIBLIOGRAPHY,
        re.MULTILINE,
    )
    assert sorted(set(re.findall(r"@(\w+)", BODY))) == sorted(entries)


def test_the_table_of_the_paper_is_that_of_the_readme():
    table = [line for line in BODY.splitlines() if line.startswith("|")]

    assert len(table) == 7
    assert set(table) <= set(README.splitlines())


def test_workflows_run_targets_of_make_and_publish_without_a_secret():
    targets = re.findall(
        r"^(\w+):",
        MAKEFILE,
        re.MULTILINE,
    )
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


def test_the_site_has_a_card_of_every_set_of_weights():
    place = ROOT / "docs/_ext/embedded_texts.py"
    spec = importlib.util.spec_from_file_location("embedded_texts", place)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    folders = [str(folder.relative_to(WEIGHTS)) for folder in WEIGHTS.glob("*/*")]

    assert {("card", folder) for folder in folders} <= set(module.MARK.findall(CARDS))
    for card in map(module.card, folders):
        assert re.search(r"\| weights \| \d{1,2},\d{3} numbers, [3-8]\d,\d{3} bytes \|", card)
        assert yaml.safe_load(card.partition("```yaml\n")[2].removesuffix("```"))
