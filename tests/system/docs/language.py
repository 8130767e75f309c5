#!/usr/bin/python3
"""Sentences of the docs have at most 40 words; code counts as one. docs/reports, which programs write, is exempt.

usage: language.py SOURCE_DIR        exit 1 and one line per place
"""
import pathlib
import re
import sys

MAX_WORDS = 40
BREAK = re.compile(r"\s*([-*]|\d+\.)\s|\||#|<!--|!\[|    |\s*$")  # list items, tables, headings, marks, code, empty lines
SKIPPED = re.compile(r"^```.*?^```$", re.M | re.S)


def find_long_sentences(text):
    text = SKIPPED.sub(lambda match: "\n" * match[0].count("\n"), text)
    paragraph, start = "", 1
    for number, line in enumerate([*text.splitlines(), ""], 1):
        if BREAK.match(line):
            for sentence in re.split(r"(?<=[.!?:;])\s+", re.sub(r"`[^`]*`|\]\([^)]*\)", "code", paragraph)):
                if len(sentence.split()) > MAX_WORDS:
                    yield start, sentence
            item = re.match(r"\s*([-*]|\d+\.)\s(.*)", line)
            paragraph, start = item[2] if item else "", number
        else:
            paragraph += " " + line.strip()


source = pathlib.Path(sys.argv[1])
pages = [source / "README.md", source / "CONTRIBUTING.md", *sorted((source / "docs").rglob("*.md"))]
pages = [page for page in pages if page.parent != source / "docs/reports"]
places = [
    f"{page.relative_to(source)}:{line}: {len(sentence.split())} words, at most {MAX_WORDS}: {sentence[:60]}..."
    for page in pages
    for line, sentence in find_long_sentences(page.read_text())
]
print("\n".join(places) if places else f"{len(pages)} pages in short sentences")
sys.exit(1 if places else 0)
