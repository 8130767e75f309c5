#!/usr/bin/python3
"""Sentences of the docs are short: at most 40 words each, and fewer than 20 on average over a page. A sentence ends at a full stop, a
question mark, a colon or a semicolon; code counts as one word; cells of tables are looked at one by one. docs/reports, which programs
write, is left out.

usage: language.py SOURCE_DIR        exit 1 and one line per place
       language.py --self-test       proves that a place is found
"""
import pathlib
import re
import statistics
import sys

MAX_WORDS, MAX_MEAN = 40, 20.0
END = re.compile(r"(?<=[.!?:;])\s+")


def find_paragraphs(text):
    """(line, prose) of paragraphs, list items and cells."""
    paragraphs, lines, start, in_code = [], [], 1, False
    for number, line in enumerate([*text.splitlines(), ""], 1):
        fence = line.lstrip().startswith("```")
        cells = not in_code and line.startswith("|")
        is_item = not in_code and re.match(r"\s*([-*]|\d+\.)\s", line)
        if fence or cells or is_item or in_code or not line.strip() or line.startswith(("#", "<!--", "![", "    ")):
            if lines:
                paragraphs.append((start, " ".join(lines)))
            lines, start = [], number
            in_code ^= fence
            if cells:
                paragraphs += [(number, cell) for cell in re.split(r"(?<!\\)\|", line)]
            elif is_item and not in_code:
                lines = [line[is_item.end() :]]
        else:
            start = start if lines else number
            lines.append(line.strip())
    return paragraphs


def count_words(paragraph):
    text = re.sub(r"`[^`]*`", "code", re.sub(r"\]\([^)]*\)", "]", paragraph))
    return [(len(sentence.split()), sentence) for sentence in END.split(text) if sentence.strip()]


def find_places(path, text):
    sentences = [(line, words, sentence) for line, prose in find_paragraphs(text) for words, sentence in count_words(prose)]
    places = [f"{path}:{line}: {words} words: {sentence[:60]}..." for line, words, sentence in sentences if words > MAX_WORDS]
    long = [words for _, words, _ in sentences if words > 3]
    if long and statistics.mean(long) >= MAX_MEAN:
        places.append(f"{path}: {statistics.mean(long):.1f} words a sentence on average, below {MAX_MEAN:g} is asked for")
    return places


def main():
    if sys.argv[1:] == ["--self-test"]:
        long = "word " * 41
        assert len(find_places("a.md", f"# T\n\nShort one is here.\n{long}.\nAnother short one here. And one more of them.\n")) == 1
        assert len(find_places("a.md", f"- {long}\n- Fine.\n\n| a | {long} |\n\n```sh\n{long}\n```\n    {long}\n")) == 3  # the mean too
        assert not find_places("a.md", f"A list: `{long}`; [a link]({long.replace(' ', '')}); and {'word ' * 15}.\n")
        return 0
    source = pathlib.Path(sys.argv[1])
    pages = [source / "README.md", source / "CONTRIBUTING.md", *sorted((source / "docs").rglob("*.md"))]
    pages = [page for page in pages if page.parent != source / "docs/reports"]
    places = [place for page in pages for place in find_places(page.relative_to(source), page.read_text())]
    print("\n".join(places) if places else f"{len(pages)} pages in short sentences")
    return 1 if places else 0


if __name__ == "__main__":
    sys.exit(main())
