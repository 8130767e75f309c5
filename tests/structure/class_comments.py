#!/usr/bin/env python3
"""Every class in a header has a /// comment right in front of it, which says what it is and what it keeps true.

usage: class_comments.py SOURCE_DIR        exit 1 and one line per class without a comment
       class_comments.py --self-test       proves that one is found
"""
import pathlib
import re
import sys

import include_law

CLASS = re.compile(r"^ *class (?:\w+\([^)]*\) )?(\w+)[^;{]*\{", re.M)
TEMPLATE = re.compile(r"^ *(?:template\b|requires\b|typename\b|class\b.*>$)")


def find_bare(text):
    """(line, name) of every class whose definition no /// comment precedes; a template's comment precedes its parameters."""
    lines = text.splitlines()
    for match in CLASS.finditer(text):
        at = text.count("\n", 0, match.start())
        before = at - 1
        while before >= 0 and TEMPLATE.match(lines[before]):
            before -= 1
        if before < 0 or not lines[before].lstrip().startswith("///"):
            yield at + 1, match[1]


def self_test():
    text = (
        "class Forward;\n"
        "/// Kept.\nclass A {\n  friend class B;\n  enum class Kind { a };\n  class B {\n  };\n};\n"
        "// Of two slashes.\nclass C final : public A {\n};\n"
        "/// Of any.\ntemplate <class T>\nclass D {\n};\n"
        "/// Apart.\n\nclass E\n    : public A {\n};\n"
        "template <class T>\nclass F {\n};\n"
    )
    assert list(find_bare(text)) == [(6, "B"), (10, "C"), (18, "E"), (22, "F")], list(find_bare(text))


def main():
    if sys.argv[1:] == ["--self-test"]:
        self_test()
        return 0
    faults, count = [], 0
    for path, text in include_law.read_tree(pathlib.Path(sys.argv[1])):
        if path.endswith(".hpp"):
            count += len(CLASS.findall(text))
            faults += [f"{path}:{line}: class {name} has no /// comment: what it is, what it keeps true" for line, name in find_bare(text)]
    print("\n".join(faults) if faults else f"{count} classes, each with a comment")
    return 1 if faults or count < 100 else 0


if __name__ == "__main__":
    sys.exit(main())
