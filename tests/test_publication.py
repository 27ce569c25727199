"""What is published besides the code: the paper and the cards of shipped weights."""

import json
import re
from pathlib import Path

import yaml

from agents.evaluation.registry import SHIPPED
from agents.learned.policy_file import hub_card

ROOT = Path(__file__).parents[1]
PUBLISHED, PAPER, CARDS = (
    (ROOT / name).read_text(encoding="utf-8")
    for name in ("docs/environments/published.md", "paper.md", "docs/agents.md")
)
BODY = PAPER.split("---\n", 2)[2]


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
        told = f"| `{card['recipe']['name']}` | [policy.json](../{path}) |"
        assert told in CARDS
        assert (ROOT / path).with_suffix(".safetensors").stat().st_size < 90_000


def test_shipped_policies_have_the_page_and_the_metadata_of_a_hub():
    for path in SHIPPED.glob("*/*/policy.json"):
        card = json.loads(path.read_text(encoding="utf-8"))
        page = path.with_name("README.md").read_text(encoding="utf-8")
        metadata = yaml.safe_load(page.split("---\n")[1])
        [result] = metadata["model-index"][0]["results"]

        assert page == hub_card(path.parent.name, card)
        assert result["dataset"]["name"] in card["environment"]
        assert result["metrics"][0]["value"] == card["measured"]["evaluation/reward"]
