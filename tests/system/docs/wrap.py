#!/usr/bin/python3
"""Prose of the pages at the root and in docs is at most 140 columns wide; tables, code, headings and what programs write between markers
are not looked at.

usage: wrap.py SOURCE_DIR          exit 1 and one line per place
       wrap.py SOURCE_DIR --fix    wraps the paragraphs
"""
import pathlib
import re
import sys
import textwrap

MAX_COLUMNS = 140
ITEM = re.compile(r"^(\s*)((?:[-*]|\d+\.)\s+)?")
BLOCK = re.compile(r"^(\||#|<!--|>|!\[|    )")
MARKED = re.compile(r"(<!-- (?:begin )?([\w: -]+?) -->\n.*?<!-- (?:/|end )\2 -->)", re.S)


def wrap_paragraph(lines):
    """A paragraph or list item; code and the targets of links stay whole."""
    indent, mark = ITEM.match(lines[0])[1], ITEM.match(lines[0])[2] or ""
    body = " ".join(line.strip() for line in lines)[len(mark) :]
    parts = re.split(r"(`[^`]*`|\]\([^)]*\))", body)
    body = "".join(part.replace(" ", "\0") if part.startswith(("`", "](")) else part for part in parts)
    wrapped = textwrap.wrap(
        body,
        MAX_COLUMNS,
        initial_indent=indent + mark,
        subsequent_indent=indent + " " * len(mark),
        break_long_words=False,
        break_on_hyphens=False,
    )
    return [line.replace("\0", " ") for line in wrapped]


def wrap_prose(text):
    out, paragraph, in_code = [], [], False
    for line in [*text.split("\n"), None]:
        fence = line is not None and line.lstrip().startswith("```")
        is_item = line is not None and not in_code and re.match(r"\s*([-*]|\d+\.)\s", line)
        ends = line is None or fence or in_code or not line.strip() or is_item or (BLOCK.match(line) and not (paragraph and line[0] == " "))
        if ends and paragraph:
            out += wrap_paragraph(paragraph)
            paragraph = []
        if line is not None and (is_item or not ends):
            paragraph.append(line)
        elif line is not None:
            in_code ^= fence
            out.append(line)
    return "\n".join(out)


def wrap(text):
    """The page with its paragraphs wrapped; regions between markers belong to the programs that write them."""
    parts = MARKED.split(text)
    return "".join(wrap_prose(part) if k % 3 == 0 else part for k, part in enumerate(parts) if k % 3 != 2)


def find_long(text):
    """Numbers of lines that wrapping would make shorter."""
    kept = set(wrap(text).split("\n"))
    return [number for number, line in enumerate(text.split("\n"), 1) if len(line) > MAX_COLUMNS and line not in kept]


def main():
    source = pathlib.Path(sys.argv[1])
    faults = []
    for page in [*sorted(source.glob("*.md")), *sorted((source / "docs").rglob("*.md"))]:
        text = page.read_text()
        if sys.argv[2:] == ["--fix"]:
            page.write_text(wrap(text))
        else:
            faults += [f"{page.relative_to(source)}:{number}: wider than {MAX_COLUMNS}; wrap.py . --fix" for number in find_long(text)]
    print("\n".join(faults) if faults else "all prose is narrow enough")
    return 1 if faults else 0


if __name__ == "__main__":
    sys.exit(main())
