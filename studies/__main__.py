"""Lists the studies: `python -m studies`."""

from pathlib import Path


def main() -> None:
    """Print the name and the question of every study that has a command."""
    for page in sorted(Path(__file__).parent.glob("*/README.md")):
        if not (page.parent / "__main__.py").is_file():
            continue
        title = page.read_text(encoding="utf-8").splitlines()[0].lstrip("# ")
        print(f"python -m studies.{page.parent.name:10}  {title}")


if __name__ == "__main__":
    main()
