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
    r"beside": "next to, in addition to, compared with",
    r"(told|tells?|telling)( them)? apart": "separated, resolved, distinguished; of sounds: audible by the metric",
    r"mend(s|ed|ing)?": "correct; of modes: refine",
    r"(un)?fore(see|sees|seen|saw|sight|seeable)": "estimate, predict; of cases: unusual",
    r"gone on (with|from)": "resumed",
    r"called from memory": "prefetched",
    r"whim": "arbitrary",
    r"besides": "in addition to, except for, compared with",
    r"anew": "again",
    r"told|tells|telling|(?<!\.)tell": "says, shows, reports, resolved",  # .tell() is the name of a file's position in libraries
    r"somebody|whoever": "name who or which program",
    r"nought": "zero",
    r"reckon(s|ed|ing)?": "compute, count",
    r"as ever": "as before",
    r"go(es|ing)? on|went on": "continues, follows",
    r"giv(e|es|ing) way|gave way": "yields",
    r"all the same": "still",
    r"equal modes?|modes that are equal": "degenerate modes",
    r"planner(?! db)": "effect selection, the selector",
    r"put(s|ting)? right(?! (before|after))": "correct",
}
ENDINGS = {".cpp", ".hpp", ".inl", ".h", ".c", ".py", ".md", ".json", ".txt", ".cmake"}
TOPS = ("runtime", "precompute", "partition", "jobs", "tests", "deploy", "docs")
WITHIN_NAMES = re.compile(r"_|(?<=[a-z0-9])(?=[A-Z])|(?<=[A-Z])(?=[A-Z][a-z])")  # the words of a_name and of ATypeName are words
EXEMPT = ("tests/structure/words.py", "docs/glossary.md")


def find_places(path, text):
    if any(path.startswith(exempt) for exempt in EXEMPT):
        return []
    pattern = re.compile(r"\b(" + "|".join(RETIRED) + r")\b", re.IGNORECASE)
    return [
        f'{path}:{number}: "{match[0]}" is retired: {advise(match[0])} (terms: docs/glossary.md)'
        for number, line in enumerate(text.splitlines(), 1)
        for match in pattern.finditer(WITHIN_NAMES.sub(" ", line))
    ]


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
        assert len(find_places("docs/x.md", "A table beside it tells more.")) == 2
        assert len(find_places("docs/reports/x.md", "Besides, it is anew.")) == 2 and len(find_places("runtime/x.cpp", "// besides")) == 1
        assert len(find_places("docs/x.md", "The planner; `planner_db`.")) == 1
        assert len(find_places("docs/x.md", "Groups of equal modes: modes that are equal.")) == 2
        assert len(find_places("tests/x.py", "def test_goes_on_all_the_same(self): tell(RingGoesOn)")) == 4
        assert not find_places("runtime/x.cpp", "io.tell = get_position;  // put right before it")
        assert len(find_places("runtime/x.cpp", "TEST(Queue, FollowsAWhim) { take(whim_of_rank, a_whim); }")) == 3
        assert not find_places("docs/x.md", "A recommendation, an amendment; refined by tearing apart what was stapled.")
        return 0
    places = [place for path, text in read_tree(pathlib.Path(sys.argv[1])) for place in find_places(path, text)]
    print("\n".join(places) if places else "no retired word")
    return 1 if places else 0


if __name__ == "__main__":
    sys.exit(main())
