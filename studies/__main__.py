"""Lists the studies: `python -m studies`."""

from pathlib import Path


def titles() -> dict[str, str]:
    """Return the title of the README of every study by its name."""
    pages = sorted(Path(__file__).parent.glob("*/README.md"))
    return {
        page.parent.name: page.read_text(encoding="utf-8").splitlines()[0].lstrip("# ")
        for page in pages
    }


def main() -> None:
    """Print the name and the question of every study."""
    found = titles()
    width = max(map(len, found), default=0)
    for name, title in found.items():
        print(f"python -m studies.{name:{width}}  {title}")


if __name__ == "__main__":
    main()
