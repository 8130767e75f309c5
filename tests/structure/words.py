#!/usr/bin/env python3
"""Retired words do not come back in code, docs or messages; the terms to use are in docs/glossary.md.

usage: words.py SOURCE_DIR        exit 1 and one line per place
       words.py --self-test       proves that a place is found
"""
import pathlib
import re
import sys

RETIRED = {
    r"nobody": "say what is not done, or by which program",
    r"(told|tells?|telling)( them)? apart": "separated, resolved, distinguished; of sounds: audible by the metric",
    r"mend(s|ed|ing)?": "correct; of modes: refine",
    r"fore(see|sees|seen|saw|sight|seeable)": "estimate, predict",
    r"gone on (with|from)": "resumed",
    r"called from memory": "prefetched",
    r"whim": "arbitrary",
}
PATTERN = re.compile(r"\b(" + "|".join(RETIRED) + r")\b", re.IGNORECASE)
ENDINGS = {".cpp", ".hpp", ".inl", ".h", ".c", ".py", ".md", ".json", ".txt", ".cmake"}
TOPS = ("runtime", "precompute", "partition", "jobs", "tests", "deploy", "docs")
EXEMPT = ("tests/structure/words.py", "docs/glossary.md")


def find_places(path, text):
    if any(path.startswith(exempt) for exempt in EXEMPT):
        return []
    return [f"{path}:{number}: \"{match[0]}\" is retired: {advise(match[0])} (terms: docs/glossary.md)"
            for number, line in enumerate(text.splitlines(), 1) for match in PATTERN.finditer(line)]


def advise(word):
    return next(advice for pattern, advice in RETIRED.items() if re.fullmatch(pattern, word, re.IGNORECASE))


def read_tree(root):
    for path in [*root.glob("*.md"), *(path for top in TOPS for path in sorted((root / top).rglob("*")))]:
        if path.is_file() and (path.suffix in ENDINGS or path.suffix == "") and "__pycache__" not in path.parts:
            try:
                yield path.relative_to(root).as_posix(), path.read_text()
            except UnicodeDecodeError:
                continue


def main():
    if sys.argv[1:] == ["--self-test"]:
        assert len(find_places("docs/x.md", "It is mended.\nFine.\nNobody tells apart what nobody hears.")) == 4
        assert not find_places("docs/x.md", "A recommendation, an amendment; refined by tearing apart what was stapled.")
        return 0
    places = [place for path, text in read_tree(pathlib.Path(sys.argv[1])) for place in find_places(path, text)]
    print("\n".join(places) if places else "no retired word")
    return 1 if places else 0


if __name__ == "__main__":
    sys.exit(main())
