"""Write what commands print today into the pages that show it.

    python scripts/release/printed_outputs.py [PAGE ...]    all pages, or these

It runs the command of each block after `<!-- printed by: COMMAND -->`, with the logs of `helisim
examples` in the folder, and puts as many lines in the block as it has, from the line that begins
with the block's first word. To show another part, change the block once by hand. Which pages
changed is printed; status 1: a command failed, or printed nothing of the kind. A test compares the
pages.
"""

import re
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).parents[2]
BLOCK = re.compile(r"(<!-- printed by: ([^\n]+) -->\n```text\n)(.+?)(^```$)", re.M | re.S)


def printed(command: str) -> list[str]:
    with tempfile.TemporaryDirectory() as folder:
        (Path(folder) / "scripts").symlink_to(ROOT / "scripts")
        examples = "helisim examples --to logs --quiet"
        words = ["bash", "-c", f"{examples} && {command}"]
        done = subprocess.run(words, cwd=folder, stdout=subprocess.PIPE, text=True, check=True)
        return done.stdout.splitlines()


def today(block: re.Match[str]) -> str:
    head, command, shown, end = block.groups()
    lines, word = printed(command), shown.split()[0]
    first = next((k for k, line in enumerate(lines) if line.split()[:1] == [word]), None)
    if first is None:
        sys.exit(f"{command} prints no line that begins with {word}")
    text = "\n".join(lines[first : first + shown.count("\n")])
    return f"{head}{text}\n{end}"


def main() -> None:
    pages = [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]
    for page in [Path(word) for word in sys.argv[1:]] or pages:
        before = page.read_text(encoding="utf-8")
        if BLOCK.search(before):
            after = BLOCK.sub(today, before)
            page.write_text(after, encoding="utf-8")
            print(f"{page}: {'as it was' if after == before else 'changed'}", flush=True)


if __name__ == "__main__":
    main()
