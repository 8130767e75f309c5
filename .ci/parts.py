#!/usr/bin/env python3
"""Which parts of `deploy/test --full` a submission runs after `deploy/test`, so that each runs at least once in four submissions.

usage: parts.py choose               prints the parts to run now; what ran, and what is due, on standard error
       parts.py record PART=ok|failed...     writes down how they ended
       parts.py check BUILD_DIR      exit 1 and one line a fault: a test without a part, a part that never has its turn
       parts.py --self-test

The parts are in four groups, and the groups take turns. The turn follows the last one in the record of this machine,
$XDG_STATE_HOME/carillon/parts.json; on a machine without one, the number of commits decides. A part that failed last time runs again.
"""
import json
import os
import pathlib
import random
import subprocess
import sys

ROOT = pathlib.Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT / "tests/support"))
import ctest

GROUPS = (("ranks", "slow", "core"), ("programs", "bench", "tidy", "threads"), ("docs", "integration"), ("sanitizers",))


def choose(record, commit_count):
    """(turn, parts) of this submission. record: {"turn": of the last one, "failed": parts that failed then}, or {}."""
    turn = (record["turn"] + 1 if "turn" in record else commit_count) % len(GROUPS)
    again = [part for group in GROUPS for part in group if part in record.get("failed", ()) and part not in GROUPS[turn]]
    return turn, [*GROUPS[turn], *again]


def describe(turn, parts, record):
    """What runs and what is due, for the log."""
    why = "the next in turn" if "turn" in record else "by the number of commits: this machine has no record"
    again = [part for part in parts if part in record.get("failed", ())]
    lines = [f"parts of --full that run now: {' '.join(parts)} ({why})"]
    if again:
        lines.append(f"failed last time, so they run again: {' '.join(again)}")
    for ahead in range(1, len(GROUPS)):
        lines.append(f"due in {ahead} submission{'s' * (ahead > 1)}: {' '.join(GROUPS[(turn + ahead) % len(GROUPS)])}")
    return "\n".join(lines)


def find_record():
    state = os.environ.get("XDG_STATE_HOME") or pathlib.Path.home() / ".local/state"
    return pathlib.Path(state) / "carillon/parts.json"


def read_record(path):
    """{} where there is none, or none that can be used."""
    try:
        record = json.loads(path.read_text())
        return {"turn": int(record["turn"]), "failed": [str(part) for part in record["failed"]]}
    except (OSError, ValueError, KeyError, TypeError):
        return {}


def write_record(path, turn, failed):
    path.parent.mkdir(parents=True, exist_ok=True)
    new = path.with_suffix(".new")
    new.write_text(json.dumps({"turn": turn, "failed": failed}) + "\n")
    new.replace(path)


def count_commits():
    return int(subprocess.run(["git", "-C", ROOT, "rev-list", "--count", "HEAD"], capture_output=True, text=True, check=True).stdout)


def find_faults(tests):
    """tests: {name: labels} of those that are no fixtures."""
    turns = {part for group in GROUPS for part in group}
    faults, known = [], set()
    for name, labels in tests.items():
        parts = [label.removeprefix("part.") for label in labels if label.startswith("part.")]
        known |= set(parts)
        if len(parts) != 1:
            faults.append(f"{name} has {len(parts)} parts, {parts}; give it one: PART in its CMakeLists.txt")
    faults += [f"no submission runs part {part}: add it to a group of .ci/parts.py" for part in sorted(known - turns - {"basic", "long"})]
    return faults


def self_test():
    every = {part for group in GROUPS for part in group}
    for seed in range(200):
        chance = random.Random(seed)
        record, count, ran = {}, chance.randrange(1000), []
        for _ in range(20):
            count += chance.randrange(1, 40)
            turn, parts = choose(record, count)
            assert set(record.get("failed", ())) <= set(parts) and len(parts) == len(set(parts)), (record, parts)
            failed = [part for part in parts if chance.random() < 0.2]
            record = {"turn": turn, "failed": failed}
            ran.append(set(parts))
        assert all(set().union(*ran[i : i + 4]) == every for i in range(len(ran) - 3)), ran
    assert find_faults({"a": ["unit", "part.basic"], "b": ["part.ranks"]}) == []
    assert len(find_faults({"a": ["unit"], "b": ["part.basic", "part.slow"], "c": ["part.new"]})) == 3
    # Without a record, four commits in a row run everything.
    assert {part for count in range(7, 11) for part in choose({}, count)[1]} == every
    assert "due in 3 submissions: sanitizers" in describe(0, ["ranks", "slow"], {"turn": 3, "failed": []})
    assert "run again: docs" in describe(0, ["ranks", "slow", "docs"], {"turn": 3, "failed": ["docs"]})


def main():
    if sys.argv[1:] == ["--self-test"]:
        return self_test()
    if sys.argv[1:2] == ["check"] and len(sys.argv) == 3:
        faults = find_faults({test["name"]: test["labels"] for test in ctest.list_tests(sys.argv[2]) if not test["is_fixture"]})
        print("\n".join(faults) or "every test has a part that has its turn")
        return bool(faults)
    path = find_record()
    record = read_record(path)
    turn, parts = choose(record, count_commits())
    if sys.argv[1:] == ["choose"]:
        print(describe(turn, parts, record), file=sys.stderr)
        print(*parts)
    elif sys.argv[1:2] == ["record"] and len(sys.argv) > 2:
        ends = dict(word.split("=", 1) for word in sys.argv[2:])
        write_record(path, turn, [part for part, end in ends.items() if end != "ok"])
    else:
        sys.exit(__doc__)


if __name__ == "__main__":
    sys.exit(main())
