#!/usr/bin/env python3
"""Arranges docs/ for mdBook, and checks the site that mdBook makes.

    book.py arrange FOLDER    writes book.toml, SUMMARY.md and the pages into FOLDER
    book.py check SITE        follows every link within the site; exit code 1 if one is broken

The book has the folders of the repository, so links between pages stay as they are. Its list of pages is that of
docs/README.md. What pages link to elsewhere in the repository comes along: pages as chapters at the end, other files as they
are, and a folder as a chapter that lists its files.
"""

import html.parser
import os
import re
import shutil
import subprocess
import sys
import urllib.parse
from pathlib import Path, PurePosixPath

INDEX = "docs/README.md"
LINK = re.compile(r"(\]\(|<img src=\")([^)\s\"]+)")
ELSEWHERE = re.compile(r"^[a-z]+:|^#|^$")


class Tree:
    """The files of the repository under version control."""

    def __init__(self):
        listed = subprocess.run(["git", "ls-files", "-z", "--cached", "--others", "--exclude-standard"], check=True, capture_output=True)
        self.files = set(listed.stdout.decode().split("\0")) - {""}

    def below(self, folder):
        return sorted(file for file in self.files if file.startswith(f"{folder}/"))


def title(text, file):
    fenced = False
    for line in text.splitlines():
        fenced ^= line.startswith("```")
        if line.startswith("# ") and not fenced:
            return re.sub(r"[`\[\]]", "", line[2:])
    return file


def prose(text):
    """The lines of a page, each with True if links in it are links."""
    fenced = False
    for line in text.splitlines(keepends=True):
        if line.lstrip().startswith("```"):
            fenced = not fenced
            yield line, False
        else:
            yield line, not fenced and not line.startswith("    ")


class Book:
    def __init__(self, tree, folder):
        self.tree, self.source = tree, folder / "src"
        self.titles = {}
        self.waiting = []

    def take(self, file):
        """Puts a page into the book, once; its links are followed later."""
        if file not in self.titles:
            self.titles[file] = file
            self.waiting.append(file)

    def page(self, file):
        text = Path(file).read_text()
        self.titles[file] = title(text, file)
        lines = []
        for line, is_prose in prose(text):
            lines.append(LINK.sub(lambda link: link[1] + self.target(file, link[2]), line) if is_prose else line)
        self.write(file, "".join(lines))

    def target(self, file, link):
        """The link as the book has it; what it leads to comes along."""
        path, mark, heading = link.partition("#")
        if ELSEWHERE.match(link) or not path:
            return link
        target = os.path.normpath(PurePosixPath(file).parent / urllib.parse.unquote(path))
        if target in self.tree.files:
            if target.endswith(".md"):
                self.take(target)
            else:
                self.copy(target)
            return link
        if not self.tree.below(target):
            sys.exit(f"book: {file} links to {link}, which does not exist")
        readme = f"{target}/README.md"
        if readme in self.tree.files:
            self.take(readme)
        else:
            self.listing(target, readme)
        return f"{path.rstrip('/')}/README.md{mark}{heading}"

    def listing(self, folder, file):
        if file in self.titles:
            return
        self.titles[file] = folder
        below = self.tree.below(folder)
        for one in below:
            self.copy(one)
        names = [one.removeprefix(f"{folder}/") for one in below]
        self.write(file, f"# {folder}\n\n" + "".join(f"- [{name}]({urllib.parse.quote(name)})\n" for name in names))

    def write(self, file, text):
        place = self.source / file
        place.parent.mkdir(parents=True, exist_ok=True)
        place.write_text(text)

    def copy(self, file):
        # mdBook makes a page of each *.md, and only of those in its summary.
        if file.endswith(".md"):
            self.take(file)
            return
        place = self.source / file
        place.parent.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(file, place)

    def summary(self):
        """The chapters of docs/README.md by its headings, then all others."""
        text, listed, lines = Path(INDEX).read_text(), set(), ["# Summary\n"]

        def chapter(file, form="- [{}]({})"):
            if file not in listed:
                listed.add(file)
                lines.append(form.format(self.titles[file].replace("[", "").replace("]", ""), file))

        chapter("README.md", "[{}]({})")
        chapter(INDEX, "[{}]({})")
        for line in text.splitlines():
            if line.startswith("## "):
                lines.append(f"\n# {line[3:]}\n")
            for _, link in LINK.findall(line):
                file = os.path.normpath(f"docs/{link.partition('#')[0]}")
                if file in self.titles:
                    chapter(file)
        lines.append("\n# Elsewhere in the repository\n")
        for file in sorted(self.titles):
            chapter(file)
        (self.source / "SUMMARY.md").write_text("\n".join(lines) + "\n")


def arrange(folder):
    folder.mkdir(parents=True)
    book = Book(Tree(), folder)
    for file in ("README.md", INDEX):
        book.take(file)
    while book.waiting:
        book.page(book.waiting.pop(0))
    book.summary()
    # Without its preprocessors, which would rename README.md and act on double braces.
    (folder / "book.toml").write_text(
        '[book]\ntitle = "tickbus"\nlanguage = "en"\n\n[build]\nuse-default-preprocessors = false\n\n'
        "[output.html]\nno-section-label = true\n\n[output.html.fold]\nenable = true\nlevel = 0\n\n"
        "[output.html.search]\nlimit-results = 30\nuse-boolean-and = true\nboost-title = 3\nexpand = true\n"
    )
    print(f"book: pages={len(book.titles)}")


class Page(html.parser.HTMLParser):
    def __init__(self, text):
        super().__init__()
        self.ids, self.links = set(), []
        self.feed(text)

    def handle_starttag(self, tag, attributes):
        known = dict(attributes)
        for key in ("id", "name"):
            if known.get(key):
                self.ids.add(known[key])
        for key in ("href", "src"):
            if known.get(key):
                self.links.append(known[key])


def check(site):
    pages = {path: Page(path.read_text()) for path in sorted(site.rglob("*.html"))}
    broken = links = 0
    for path, page in pages.items():
        if path.name in ("print.html", "404.html"):
            continue
        for link in page.links:
            if re.match(r"[a-z]+:|//", link):
                continue
            links += 1
            file, _, heading = link.partition("#")
            target = Path(os.path.normpath(path.parent / urllib.parse.unquote(file))) if file else path
            if not target.is_file():
                print(f"book: {path}: links to {link}, which does not exist")
                broken += 1
            elif heading and target in pages and urllib.parse.unquote(heading) not in pages[target].ids:
                print(f"book: {path}: links to {link}, a heading that does not exist")
                broken += 1
    if broken:
        sys.exit(f"book: failed broken={broken} links={links}")
    print(f"book: ok pages={len(pages)} links={links} open={site / 'index.html'}")


match sys.argv[1:]:
    case ["arrange", folder]:
        arrange(Path(folder))
    case ["check", site]:
        check(Path(site))
    case _:
        sys.exit(__doc__)
