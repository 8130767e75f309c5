"""Tests of a build, listed by CTest."""
import json
import subprocess


def list_tests(build, *choice):
    """[{"name", "command": words, "labels", "is_fixture"}] of the tests selected by these CTest arguments."""
    listed = subprocess.run(["ctest", "--test-dir", build, *choice, "--show-only=json-v1"], capture_output=True, text=True, check=True)
    tests = []
    for test in json.loads(listed.stdout)["tests"]:
        properties = {entry["name"]: entry["value"] for entry in test["properties"]}
        tests.append(
            {
                "name": test["name"],
                "command": test.get("command", []),
                "labels": properties.get("LABELS", []),
                "is_fixture": "FIXTURES_SETUP" in properties or "FIXTURES_CLEANUP" in properties,
            }
        )
    return tests
