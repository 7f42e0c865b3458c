#!/usr/bin/env python3
"""documents.py FOLDER | documents.py FOLDER check: makes the pages in FOLDER those of a zip, or checks that each link in them leads
somewhere.

The pages are written for the repository. In a zip, pages for tickbus' own developers are left out, links to what the zip does not
have become plain text, and commands that the zip has under another name get that name. A page with other commands of the
sources says so at its top.
"""

import re
import sys
from pathlib import Path

# For those who change tickbus itself.
OF_DEVELOPERS = ["docs/ARCHITECTURE.md", "docs/release.md", "docs/testing-tickbus.md"]

# Commands of the repository, and those of the zip.
COMMANDS = {
    "make demo-peeler": "bin/demo-peeler",
    "make demo": "bin/demo",
    "target/release/tickbus": "bin/tickbus",
    "java/simulator/target/simulator-": "simulator/simulator-",
    "target/demo/DeviceDriver": "DeviceDriver",
}

# Commands that only the sources have.
OF_SOURCES = re.compile(r"(`|^ {4}(\$ )?)(make [a-z]|cargo [a-z]|mvn -f java|tools/[a-z])", re.MULTILINE)

NOTE = "*Commands on this page that begin with `make`, `cargo`, `mvn -f java` or `tools/` need the sources of tickbus.*"

LINK = re.compile(r"(!?)\[([^\]]*)\]\(([^)#\s]+)(#[^)\s]*)?\)")


def leads_nowhere(page: Path, target: str) -> bool:
    return "://" not in target and not target.startswith("mailto:") and not (page.parent / target).exists()


def of_zip(page: Path, text: str, folder: Path) -> str:
    lines = []
    for line in text.splitlines():
        gone = [target for _, _, target, _ in LINK.findall(line) if leads_nowhere(page, target)]
        # A row of a list that is about a page which is not there.
        about = LINK.match(line.lstrip("-| "))
        if about and about.group(3) in gone and page == folder / "docs/README.md":
            continue
        line = LINK.sub(lambda link: link.group(2) if link.group(3) in gone else link.group(0), line)
        for own, other in COMMANDS.items():
            line = re.sub(re.escape(own) + r"(?![a-z-])", other, line)
        lines.append(line)
    text = "\n".join(lines) + "\n"
    if OF_SOURCES.search(text) and page.is_relative_to(folder / "docs"):
        title, _, rest = text.partition("\n")
        text = f"{title}\n\n{NOTE}\n{rest}"
    return text


def main() -> int:
    folder = Path(sys.argv[1])
    pages = sorted(folder.rglob("*.md"))
    if sys.argv[2:] == ["check"]:
        dead = [
            f"{page.relative_to(folder)}: {target}"
            for page in pages
            for _, _, target, _ in LINK.findall(page.read_text(encoding="utf-8"))
            if leads_nowhere(page, target)
        ]
        print(*dead, sep="\n", end="\n" if dead else "")
        return 1 if dead else 0
    for name in OF_DEVELOPERS:
        (folder / name).unlink(missing_ok=True)
    for page in sorted(folder.rglob("*.md")):
        page.write_text(of_zip(page, page.read_text(encoding="utf-8"), folder), encoding="utf-8")
    return 0


sys.exit(main())
