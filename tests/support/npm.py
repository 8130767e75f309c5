"""Packages of npm for tests, which have no others from outside."""
import json
import subprocess


def install(folder, **packages):
    """Installs packages (name=version, _ for -) into node_modules of a folder.
    False, with a line that says why, where the registry cannot be reached."""
    dependencies = {name.replace("_", "-"): version for name, version in packages.items()}
    (folder / "package.json").write_text(json.dumps({"private": True, "type": "module", "dependencies": dependencies}))
    words = ["npm", "install", "--ignore-scripts", "--no-audit", "--no-fund", "--loglevel=error", "--fetch-retries=1"]
    done = subprocess.run([*words, "--fetch-retry-mintimeout=1000"], cwd=folder, capture_output=True, text=True)
    if done.returncode != 0:
        first = (done.stderr.strip() or "no message").splitlines()[0]
        print(f"not tested: npm could not fetch {', '.join(dependencies)} ({first})")
    return done.returncode == 0
