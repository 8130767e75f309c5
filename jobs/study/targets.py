"""Bodies outside the study: command line arguments, and jobs for them."""
import copy
import pathlib

import job_file
from errors import InputError

SURFACES, MESHES = (".obj", ".stl", ".ply", ".off"), (".msh", ".vtu", ".mesh", ".node", ".ele", ".vtk", ".vtkhdf", ".hdf", ".h5")
SHAPES = ("bar", "tube", "plate", "sphere", "bowl", "box", "hollow-box", "cylinder", "disc", "ring", "cone")
STEEL = {
    "young_modulus_pa": 200e9,
    "poisson_ratio": 0.3,
    "density_kg_m3": 7850,
    "damping": {"rayleigh": {"alpha1_s": 1e-7, "alpha2_per_s": 0.5}},
}
STEEL_TEXT = "steel (200 GPa, nu 0.3, 7850 kg/m^3), since no material was given"


class Target:
    """A body to solve. template: a job without mesh size, element, tolerance and bank; kind: "shape", "surface" or "mesh"."""

    def __init__(self, name, template, kind, notes=()):
        self.name, self.template, self.kind, self.notes = name, template, kind, list(notes)

    def list_files(self):
        """Input files of the job."""
        return [file for file in (self.template.get("mesh"), self.template.get("body", {}).get("surface")) if file]

    def make_job(self, setting):
        job = copy.deepcopy(self.template)
        element, _, mass = setting.element.partition(" ")
        job["element"], job["mass"] = element, mass or "consistent"
        job["solver"] = dict(job.get("solver", {})) | {"tolerance": setting.tolerance}
        if self.kind != "mesh":
            job["body"]["nodes"] = setting.nodes
        return job


def find_target(word, wall_m=None, height_m=None, band_hz=None):
    """Target of a command line argument that is not a body of the study. InputError with alternatives."""
    path = pathlib.Path(word)
    ending = path.suffix.lower()
    if not path.exists() and word in SHAPES:
        target = Target(
            word, {"body": {"shape": word}, "material": STEEL}, "shape", [f"shape {word} with its default dimensions; {STEEL_TEXT}"]
        )
    elif ending in SURFACES + MESHES + (".json",) or path.exists():
        target = find_file(path, ending)
    else:
        return None
    if (wall_m is not None or height_m is not None) and target.kind != "surface":
        raise InputError(f"{word}: --wall and --height are for surface files; this is a {target.kind}")
    target.template.get("body", {}).update({key: value for key, value in (("wall_m", wall_m), ("height_m", height_m)) if value is not None})
    if band_hz is not None:
        target.template["band_hz"] = list(band_hz)
    return target


def find_file(path, ending):
    if not path.exists():
        raise InputError(f"{path}: no such file")
    if not path.is_file():
        raise InputError(f"{path}: not a regular file; give a job, a mesh or a surface")
    full = str(path.resolve())
    if ending == ".json":
        return find_job(path)
    if ending in SURFACES:
        return Target(path.name, {"body": {"surface": full}, "material": STEEL}, "surface", [STEEL_TEXT])
    if ending in MESHES:
        return Target(path.name, {"mesh": full, "material": STEEL}, "mesh", [STEEL_TEXT])
    raise InputError(
        f"{path}: the ending says what a file is, and {repr(ending) if ending else 'this one has none, which'} is none of a job (.json), a"
        f" surface ({', '.join(SURFACES)}) or a mesh ({', '.join(MESHES[:4])} ...)"
    )


def find_job(path):
    job = job_file.read_job(path)
    kinds = [key for key in ("body", "mesh") if key in job]
    if len(kinds) != 1:
        raise InputError(
            f'{path}: the job has {"both" if kinds else "neither"} "body" {"and" if kinds else "nor"} "mesh"; give one of them'
        )
    folder = path.resolve().parent
    kind = "mesh"
    if kinds == ["mesh"]:
        job["mesh"] = resolve(path, folder, job["mesh"])
    else:
        if not isinstance(job["body"], dict):
            raise InputError(f'{path}: key "body" is no object')
        kind = "surface" if "surface" in job["body"] else "shape"
        job["body"] = {key: value for key, value in job["body"].items() if key not in ("nodes", "edge_m")}
        if kind == "surface":
            job["body"]["surface"] = resolve(path, folder, job["body"]["surface"])
    if not isinstance(job.get("solver", {}), dict):
        raise InputError(f'{path}: key "solver" is no object')
    given = [key for key in ("element", "mass", "accuracy_cents", "resources") if key in job]
    for key in (*given, "bank", "run"):
        job.pop(key, None)
    notes = [f"what the job says of {', '.join(given)} is left out: that is chosen here"] if given else []
    return Target(path.name, job, kind, notes)


def resolve(job_file, folder, path):
    if not isinstance(path, str):
        raise InputError(f"{job_file}: {path!r} is not a path")
    found = (folder / path).resolve()
    if not found.is_file():
        raise InputError(
            f"{job_file}: {path}: {'this is no regular file' if found.exists() else 'there is no such file'} (paths are from the job's"
            " folder)"
        )
    return str(found)
