#!/usr/bin/env python3
"""One version in CMakeLists.txt, CITATION.cff and CHANGELOG.md, and in these files at the tag of the release.

The first heading of CHANGELOG.md has the version of CMakeLists.txt, and its date or "not released". The first heading with a date is the
release: CITATION.cff has its version and date, and its tag is v0.2.0. Commits after the tag have the next version.

usage: version.py SOURCE_DIR
       version.py --self-test
"""
import datetime
import pathlib
import re
import subprocess
import sys
import tempfile

FILES = ("CMakeLists.txt", "CHANGELOG.md", "CITATION.cff")


def read_git(source, *words):
    """Output of git, or None where it fails: no such tag, or no repository."""
    done = subprocess.run(["git", "-C", source, *words], capture_output=True, text=True)
    return done.stdout if done.returncode == 0 else None


def find_versions(texts):
    """(version of CMake, [(version, date or "not released")] of the changes, version and date of the citation)."""
    cmake = re.search(r"^project\(carillon VERSION (\S+) ", texts["CMakeLists.txt"], re.M)[1]
    changes = re.findall(r"^## (\d+\.\d+\.\d+)(?:, (.+))?$", texts["CHANGELOG.md"], re.M)
    cited = [re.search(rf"^{key}: (\S+)$", texts["CITATION.cff"], re.M) for key in ("version", "date-released")]
    return cmake, changes, tuple(match and match[1] for match in cited)


def find_release(texts):
    """(version, date) of the first change with a date."""
    return next(((version, date) for version, date in find_versions(texts)[1] if re.fullmatch(r"\d{4}-\d\d-\d\d", date)), (None, None))


def find_faults(texts):
    cmake, changes, cited = find_versions(texts)
    release = find_release(texts)
    faults = []
    if not changes or changes[0][0] != cmake:
        faults.append(f"CMakeLists.txt has {cmake}, the first heading of CHANGELOG.md {changes[:1]}")
    if changes and changes[0] != release and changes[0][1] != "not released":
        faults.append(f"CHANGELOG.md: {changes[0][0]} has neither a date nor 'not released'")
    if cited != release:
        faults.append(f"CITATION.cff has {cited}, the release of CHANGELOG.md is {release}")
    try:
        datetime.date.fromisoformat(release[1] or "")
    except ValueError:
        faults.append(f"CHANGELOG.md: {release[1]} is not a date")
    return faults


def read_texts(source, tag=None):
    return {name: read_git(source, "show", f"{tag}:{name}") if tag else (source / name).read_text() for name in FILES}


def find_tag(source):
    """The tag of the release, or None in a checkout without it."""
    tag = f"v{find_release(read_texts(source))[0]}"
    return tag if read_git(source, "rev-parse", "--verify", "--quiet", f"refs/tags/{tag}^{{commit}}") else None


def check(source):
    """Faults of the checkout and of its tag."""
    texts, tag = read_texts(source), find_tag(source)
    faults = find_faults(texts)
    cmake = find_versions(texts)[0]
    if not tag:
        print(f"{cmake}; this checkout has no tag of the release {find_release(texts)[0]}")
        return faults
    print(f"{cmake}; {tag} is {read_git(source, 'rev-parse', tag + '^{commit}').strip()}")
    tagged = read_texts(source, tag)
    faults += [f"{tag}: {fault}" for fault in find_faults(tagged)]
    if f"v{find_versions(tagged)[0]}" != tag:
        faults.append(f"{tag}: the version of its CMakeLists.txt is {find_versions(tagged)[0]}")
    if f"v{cmake}" == tag and (read_git(source, "rev-list", "--count", f"{tag}..HEAD") or "0").strip() != "0":
        faults.append(f"commits after {tag} need the next version (CONTRIBUTING.md, Releasing)")
    return faults


def write(source, version, heading, release):
    (source / "CMakeLists.txt").write_text(f"project(carillon VERSION {version} LANGUAGES CXX)\n")
    (source / "CHANGELOG.md").write_text("# Changes\n\n" + heading + "## 0.1.0\n")
    (source / "CITATION.cff").write_text("version: {}\ndate-released: {}\n".format(*release))


def self_test():
    """A repository before the tag, at the tag, after it and with the next version; and each fault."""
    first = "## 0.2.0, 2026-01-31\n\n"
    release = ("0.2.0", "2026-01-31")
    with tempfile.TemporaryDirectory() as folder:
        source = pathlib.Path(folder)
        name = ["-c", "user.name=test", "-c", "user.email=test@carillon.invalid", "-c", "commit.gpgsign=false"]

        def commit():
            assert read_git(source, "add", ".") is not None
            assert read_git(source, *name, "commit", "-q", "--allow-empty", "-m", "x") is not None

        assert read_git(source, "init", "-q") is not None
        write(source, "0.2.0", first, release)
        commit()
        assert not check(source)
        assert read_git(source, "tag", "v0.2.0") is not None
        assert not check(source)
        commit()
        assert len(check(source)) == 1, "a commit after the tag with its version"
        opened = "## 0.3.0, not released\n\n" + first
        write(source, "0.3.0", opened, release)
        commit()
        assert not check(source)
        for version, heading, cited in (
            ("0.2.0", opened, release),
            ("0.3.0", "## 0.3.0\n\n" + first, release),
            ("0.3.0", opened, ("0.3.0", "2026-01-31")),
            ("0.3.0", opened, ("0.2.0", "2026-01-30")),
            ("0.3.0", opened.replace("01-31", "02-31"), ("0.2.0", "2026-02-31")),
        ):
            write(source, version, heading, cited)
            assert check(source), (version, heading, cited)
        write(source, "0.3.0", opened, release)
        commit()
        assert read_git(source, "tag", "--force", "v0.2.0") is not None
        assert len(check(source)) == 1, "the tag of another version"


def main():
    if sys.argv[1:] == ["--self-test"]:
        return self_test()
    faults = check(pathlib.Path(sys.argv[1]))
    print("\n".join(faults))
    return 1 if faults else 0


if __name__ == "__main__":
    sys.exit(main())
