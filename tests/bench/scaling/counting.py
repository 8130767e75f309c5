"""What count_mapping says, as data; and which meshes are counted for docs/reports/scaling.md."""
import subprocess

BUNNY = "/usr/share/glmark2/models/bunny.obj"
T10 = [BUNNY, "--height", 0.1, "--wall", 0.005, "--nodes", 102730, "--order", 2]
T4 = lambda nodes: [BUNNY, "--height", 0.13, "--wall", 0.005, "--nodes", nodes]
ALL = (2, 4, 8, 16, 32, 64)
# name: (arguments of carillon-mesh, refinements, ranks)
SERIES = {
    "t10": (T10, 0, ALL),
    "million": (T4(45000), 1, ALL),
    "many ranks": (T4(45000), 1, (128, 256, 512, 1024)),
    "large": (T4(37000), 2, (64, 1024)),
    **{f"weak {ranks}": (T4(5500 * ranks), 0, (ranks,)) for ranks in ALL},
}


def read_table(text):
    """{"unknowns", "operations", "entries": of the order that one rank makes, "rows": [{column: number}]} of count_mapping's output."""
    head, names, *lines = text.splitlines()
    words = head.replace(",", "").split()
    names = names.split(",")
    rows = [dict(zip(names, map(float, line.split(",")))) for line in lines]
    return {
        "unknowns": int(words[1]),
        "operations": float(words[words.index("operations") - 1]),
        "entries": float(words[words.index("entries") - 1]),
        "rows": rows,
    }


def count(program, mesh, refinements, ranks):
    command = [str(program), str(mesh), str(refinements), ",".join(map(str, ranks))]
    return read_table(subprocess.run(command, capture_output=True, text=True, check=True).stdout)


def list_shared(counted):
    """What a tree of fronts is fitted to."""
    return [(row["ranks"], row["shared_operations"] * row["operations"], row["shared_entries"] * row["entries"]) for row in counted["rows"]]
