"""Lists the studies: `python -m studies`."""

from pathlib import Path


def main() -> None:
    """Print the name and the question of every study."""
    for page in sorted(Path(__file__).parent.glob("*/README.md")):
        title = page.read_text(encoding="utf-8").splitlines()[0].lstrip("# ")
        print(f"python -m studies.{page.parent.name:10}  {title}")


if __name__ == "__main__":
    main()
