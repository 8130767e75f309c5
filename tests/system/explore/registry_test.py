#!/usr/bin/python3
"""Without npm's registry the build succeeds without the page, with one line of output."""
import os
import pathlib
import subprocess
import tempfile

PAGE = pathlib.Path(os.environ["CARILLON_SOURCE_DIR"]) / "jobs/front/explore"

with tempfile.TemporaryDirectory() as scratch:
    folder = pathlib.Path(scratch)
    done = subprocess.run(
        [
            "cmake",
            "-DNPM=npm",
            f"-DFROM={PAGE / 'page'}",
            f"-DWORK={folder / 'work'}",
            f"-DTO={folder / 'page'}",
            "-DSOURCES=index.html",
            "-P",
            PAGE / "make_page.cmake",
        ],
        env=os.environ | {"npm_config_registry": "http://127.0.0.1:9", "npm_config_cache": str(folder / "cache")},
        capture_output=True,
        text=True,
        timeout=60,
    )
    said = done.stdout + done.stderr
    assert done.returncode == 0, said
    lines = [line for line in said.splitlines() if line.strip()]
    assert len(lines) == 1 and "carillon explore has no page" in lines[0] and "three.js" in lines[0], said
    assert not (folder / "page").exists(), "there is half a page"
