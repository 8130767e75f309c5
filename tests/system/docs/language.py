#!/usr/bin/python3
"""Sentences of the docs have at most 40 words, and below 20 on average of a page; code counts as one word. docs/reports, which programs
write, is exempt.

usage: language.py SOURCE_DIR        exit 1 and one line per place
"""
import pathlib
import re
import statistics
import sys

MAX_WORDS, MAX_MEAN = 40, 20.0
BREAK = re.compile(r"\s*([-*]|\d+\.)\s|\||#|<!--|!\[|    |\s*$")  # list items, tables, headings, marks, code, empty lines
SKIPPED = re.compile(r"^```.*?^```$", re.M | re.S)


def find_sentences(text):
    """(line, words, sentence) of paragraphs, list items and cells of tables."""
    text = SKIPPED.sub(lambda match: "\n" * match[0].count("\n"), text)
    paragraph, start = "", 1
    for number, line in enumerate([*text.splitlines(), ""], 1):
        if not BREAK.match(line):
            paragraph += " " + line.strip()
            continue
        cells = re.split(r"(?<!\\)\|", line) if line.startswith("|") else []
        for at, prose in ((start, paragraph), *((number, cell) for cell in cells)):
            for sentence in re.split(r"(?<=[.!?:;])\s+", re.sub(r"`[^`]*`|\]\([^)]*\)", "code", prose)):
                yield at, len(sentence.split()), sentence
        item = re.match(r"\s*([-*]|\d+\.)\s(.*)", line)
        paragraph, start = item[2] if item else "", number


source = pathlib.Path(sys.argv[1])
pages = [source / "README.md", source / "CONTRIBUTING.md", *sorted((source / "docs").rglob("*.md"))]
pages = [page for page in pages if page.parent != source / "docs/reports"]
places = []
for page in pages:
    sentences = list(find_sentences(page.read_text()))
    name = page.relative_to(source)
    places += [f"{name}:{at}: {words} words, at most {MAX_WORDS}: {text[:60]}..." for at, words, text in sentences if words > MAX_WORDS]
    mean = statistics.mean([words for _, words, _ in sentences if words > 3] or [0])
    places += [f"{name}: {mean:.1f} words a sentence on average, not below {MAX_MEAN:g}"] if mean >= MAX_MEAN else []
print("\n".join(places) if places else f"{len(pages)} pages in short sentences")
sys.exit(1 if places else 0)
