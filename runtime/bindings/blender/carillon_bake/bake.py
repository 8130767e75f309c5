"""A bake: bodies to banks, a scene to sound and poses, poses to keyframes.

bake() is a generator, whose steps give (share, text) while the programs run. Closing it ends them and leaves nothing: objects, sequencer
and files are changed in the last step alone.
"""
import bisect
import dataclasses
import json
import os
import pathlib
import shutil
import subprocess
import tempfile
import time

import bpy
import mathutils
import numpy

from . import bodies as scene_bodies
from .bodies import BakeError

STRIP = "Carillon"  # name of the strip, and its mark
SOLVE_SHARE = 0.7  # of the progress, all bodies
END_S = 10  # wait for a program that was asked to end
MAX_CHANNEL = 32
MAX_DURATION_S = 3600
LAST_WORDS = 400  # characters of a program's message


@dataclasses.dataclass
class Baked:
    summary: str
    notes: list


class Programs:
    """Starts programs of Carillon and waits for them in steps."""

    def __init__(self, folder, work):
        self.work = work
        self.path = os.pathsep.join(filter(None, [folder, os.environ.get("PATH", "")]))

    def run(self, name, *words, text=""):
        """Generator: steps with the last line of its messages; returns standard output. BakeError if it fails."""
        program = shutil.which(name, path=self.path)
        if not program:
            raise BakeError(
                f"the program {name} is not installed; install Carillon, or give its folder in Preferences > Add-ons > Carillon"
            )
        files = [self.work / f"{name}.{kind}" for kind in ("in", "out", "err")]
        files[0].write_text(text)
        with open(files[0]) as given, open(files[1], "w") as out, open(files[2], "w") as err:
            process = subprocess.Popen(
                [program, *map(str, words)], stdin=given, stdout=out, stderr=err, cwd=self.work, env={**os.environ, "PATH": self.path}
            )
        try:
            while process.poll() is None:
                yield find_last_line(files[2])
        finally:
            end(process)
        if process.returncode:
            raise BakeError(describe_failure(name, process.returncode, files[2].read_text(errors="replace")))
        return files[1].read_text()


def end(process):
    """Ends a program that still runs; the programs of Carillon then end what they started, and remove their temporary files."""
    if process.poll() is None:
        process.terminate()
        try:
            process.wait(END_S)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()


def find_last_line(file):
    lines = file.read_text(errors="replace").strip().splitlines()
    return lines[-1] if lines else ""


def find_warnings(file):
    return [line.split("warning: ", 1)[1] for line in file.read_text(errors="replace").splitlines() if "warning: " in line]


def describe_failure(name, code, messages):
    lines = [line for line in messages.strip().splitlines() if line.startswith((f"{name}:", "carillon"))] or messages.strip().splitlines()
    return lines[-1][-LAST_WORDS:] if lines else f"{name} ended with the code {code}"


def read_materials(programs):
    """Generator; returns every name and every other name of a material in small letters -> the material."""
    listed = json.loads((yield from in_steps(programs.run("carillon", "--json", "materials"), 0.0, "materials")))
    return {word.lower(): material["name"] for material in listed["materials"] for word in [*material.get("also", []), material["name"]]}


def in_steps(run, share, text):
    """Generator: the steps of a program as (share, text)."""
    try:
        while True:
            line = next(run)
            yield share, f"{text}: {line}" if line else text
    except StopIteration as done:
        return done.value
    finally:
        run.close()


def write_surface(file, body):
    lines = [f"v {x!r} {y!r} {z!r}" for x, y, z in body.points_m.tolist()]
    lines += [f"f {a} {b} {c}" for a, b, c in (body.triangles + 1).tolist()]
    file.write_text("\n".join(lines) + "\n")


def make_banks(programs, bodies, cache, cents):
    """Generator; returns the bank of each body. Equal bodies share one, and those of earlier bakes are found in the cache."""
    banks = []
    for number, body in enumerate(bodies):
        surface = programs.work / f"body{number}.obj"
        write_surface(surface, body)
        job = {"body": {"surface": surface.name}, "material": body.material}
        if body.item.carillon_wall_m > 0:
            job["body"].update(wall_m=body.item.carillon_wall_m, side="outside")
        if cents > 0:
            job["accuracy_cents"] = cents
        words = ["--json", "bank-for", "-", "--name", programs.work / "body.json", *(["--cache", cache] if cache else [])]
        share = SOLVE_SHARE * number / len(bodies)
        run = programs.run("carillon", *words, text=json.dumps(job))
        try:
            made = json.loads((yield from in_steps(run, share, f"modes of {body.name} ({number + 1} of {len(bodies)})")))
        except BakeError as error:
            raise BakeError(f"object {body.name}: {error}") from None
        banks.append((made["bank"], made["is_new"], [f"object {body.name}: {warning}" for warning in made["warnings"]]))
    return banks


def describe_scene(scene, bodies, floor, banks, duration_s):
    """The scene file of Carillon."""
    unit = scene.unit_settings.scale_length
    described = {
        "duration_s": duration_s,
        "sample_rate_hz": min(192000, max(8000, scene.render.ffmpeg.audio_mixrate)),
        "gravity_m_s2": [unit * x for x in scene.gravity] if scene.use_gravity else [0, 0, 0],
        "bodies": [],
    }
    for body, (bank, *_) in zip(bodies, banks):
        restitution, friction = scene_bodies.find_surface_values(body.item)
        entry = {
            "name": body.name,
            "bank": bank,
            "position_m": list(body.place_m),
            "quaternion": list(body.turn),
            "restitution": restitution,
            "friction": friction,
        }
        if body.is_active:
            entry["velocity_m_s"] = [unit * x for x in body.item.carillon_velocity]
            entry["angular_velocity_rad_s"] = list(body.item.carillon_angular_velocity)
        else:
            entry["fixed"] = True
        described["bodies"].append(entry)
    if floor:
        described["ground"] = {
            "height_m": floor.height_m,
            "material": floor.material,
            "restitution": floor.restitution,
            "friction": floor.friction,
        }
    if scene.camera:
        matrix = scene.camera.matrix_world
        ahead = matrix.to_3x3() @ mathutils.Vector((0, 0, -1))
        described["listener"] = {"position_m": [unit * x for x in matrix.translation], "facing": list(ahead.normalized())}
    return described


def find_poses(rows, times_s):
    """Places (N, 3) and rotations at times from rows [t, x, y, z, qw, qx, qy, qz]: straight lines and arcs between them."""
    known = [row[0] for row in rows]
    poses = []
    for time_s in times_s:
        after = min(len(rows) - 1, bisect.bisect_right(known, time_s))
        before = max(0, after - 1)
        span = known[after] - known[before]
        part = min(1.0, max(0.0, (time_s - known[before]) / span)) if span > 0 else 0.0
        a, b = rows[before], rows[after]
        place = [(1 - part) * x + part * y for x, y in zip(a[1:4], b[1:4])]
        poses.append((place, mathutils.Quaternion(a[4:]).slerp(mathutils.Quaternion(b[4:]), part)))
    return poses


def make_curves(body, rows, times_s, unit):
    """(N, 3) locations and (N, 4) quaternions of the object among its parents."""
    item = body.item
    above = item.parent.matrix_world @ item.matrix_parent_inverse if item.parent else mathutils.Matrix()
    back = above.inverted()
    unscale = mathutils.Matrix.Diagonal(item.scale).inverted()
    locations, turns = [], []
    for place, turn in find_poses(rows, times_s):
        world = mathutils.Matrix.Translation([x / unit for x in place]) @ (turn.to_matrix() @ body.stretch).to_4x4()
        own = back @ world
        rotation = own.to_3x3() @ unscale
        if not numpy.allclose(rotation @ rotation.transposed(), numpy.eye(3), atol=1e-4):
            raise BakeError(f"object {item.name}: its parent has another scale along each axis; apply the parent's scale (Ctrl A)")
        rotation = rotation.to_quaternion()
        if turns:
            rotation.make_compatible(turns[-1])
        locations.append(own.translation.copy())
        turns.append(rotation)
    return numpy.array(locations, float), numpy.array(turns, float)


def set_keyframes(item, frames, curves):
    """Replaces the curves of location and rotation; others of the object's action stay."""
    animation = item.animation_data or item.animation_data_create()
    if animation.action is None:
        animation.action = bpy.data.actions.new(f"{item.name} Carillon")
    elif animation.action.users > 1:
        animation.action = animation.action.copy()
    action = animation.action
    for curve in list(action.fcurves):
        if curve.data_path == "location" or curve.data_path.startswith("rotation"):
            action.fcurves.remove(curve)
    for path, columns in zip(("location", "rotation_quaternion"), curves):
        for index in range(columns.shape[1]):
            curve = action.fcurves.new(path, index=index, action_group="Carillon")
            points = curve.keyframe_points
            points.add(len(frames))
            points.foreach_set("co", numpy.stack([frames, columns[:, index]], axis=1).ravel())
            points.foreach_set(
                "interpolation", [bpy.types.Keyframe.bl_rna.properties["interpolation"].enum_items["LINEAR"].value] * len(frames)
            )
            curve.update()
    item.rotation_mode = "QUATERNION"
    item.location, item.rotation_quaternion = curves[0][0], curves[1][0]
    if item.rigid_body:
        item.rigid_body.kinematic = True  # Blender's own physics follows the keyframes


def set_strip(scene, sound, first_frame, is_packed):
    """Replaces the strip of an earlier bake."""
    editor = scene.sequence_editor or scene.sequence_editor_create()
    for strip in [one for one in editor.sequences_all if one.type == "SOUND" and one.get("carillon")]:
        old = strip.sound
        editor.sequences.remove(strip)
        if old is not None and old.users == 0:
            bpy.data.sounds.remove(old)
    taken = {
        strip.channel for strip in editor.sequences if strip.frame_final_end > first_frame and strip.frame_final_start <= scene.frame_end
    }
    channel = next((number for number in range(1, MAX_CHANNEL + 1) if number not in taken), MAX_CHANNEL)
    name = str(sound) if is_packed else bpy.path.relpath(str(sound))
    strip = editor.sequences.new_sound(STRIP, name, channel, first_frame)
    strip["carillon"] = True
    if is_packed:
        strip.sound.pack()


def find_home():
    """Folder of sounds, scene and banks next to the .blend; None before it is saved."""
    return pathlib.Path(bpy.data.filepath).parent / "carillon" if bpy.data.filepath else None


def bake(context, folder=""):
    """Generator of (share, text); returns Baked. `folder`: of the programs, if they are not on the PATH. Throws BakeError."""
    scene = context.scene
    fps = scene.render.fps / scene.render.fps_base
    frames = numpy.arange(scene.frame_start, scene.frame_end + 1)
    duration_s = len(frames) / fps
    if duration_s > MAX_DURATION_S:
        raise BakeError(f"the scene has {duration_s:.0f} s; set its last frame so that it has at most {MAX_DURATION_S}")
    begin_s, home = time.monotonic(), find_home()
    work = pathlib.Path(tempfile.mkdtemp(prefix="carillon-"))
    try:
        programs = Programs(folder, work)
        known = yield from read_materials(programs)
        bodies, floor = collect_at_start(context, known)
        banks = yield from make_banks(programs, bodies, home and home / "banks", scene.carillon_accuracy_cents)
        file = work / "scene.json"
        file.write_text(json.dumps(describe_scene(scene, bodies, floor, banks, duration_s), indent=1) + "\n")
        run = programs.run("carillon-render", file, "-o", work / "sound.wav", "--trajectory", work / "path.json")
        yield from in_steps(run, SOLVE_SHARE, "sound")
        warnings = find_warnings(work / "carillon-render.err")
        paths = json.loads((work / "path.json").read_text())["bodies"]
        times_s = (frames - frames[0]) / fps
        curves = [
            (body, make_curves(body, path["poses"], times_s, scene.unit_settings.scale_length))
            for body, path in zip(bodies, paths)
            if body.is_active
        ]
        yield 1.0, "keyframes"
        # From here on nothing can be cancelled.
        sound = keep_files(work, home, scene)
        set_strip(scene, sound, scene.frame_start, home is None)
        for body, curve in curves:
            set_keyframes(body.item, frames, curve)
        scene.frame_set(scene.frame_current)
    except ReferenceError:
        raise BakeError("an object was removed during the bake; bake again") from None
    except OSError as error:
        raise BakeError(f"{error.filename}: {error.strerror}") from None
    finally:
        shutil.rmtree(work, ignore_errors=True)
    warnings += [warning for *_, own in banks for warning in own]
    solved = sum(is_new for _, is_new, _ in banks)
    summary = f"{len(frames)} frames of {len(curves)} objects, {solved} of {len(bodies)} banks computed, {time.monotonic() - begin_s:.1f} s"
    return Baked(summary, warnings)


def collect_at_start(context, known):
    """The bodies at the first frame; the current frame stays."""
    scene = context.scene
    frame, part = scene.frame_current, scene.frame_subframe
    scene.frame_set(scene.frame_start)
    try:
        bodies, floor = scene_bodies.collect(context, known)
    finally:
        scene.frame_set(frame, subframe=part)
    if not any(body.is_active for body in bodies):
        raise BakeError("no object moves; make one active: Object > Carillon > Body, or a rigid body")
    return bodies, floor


def keep_files(work, home, scene):
    """Moves sound and scene next to the .blend; returns the sound."""
    if home is None:
        kept = pathlib.Path(bpy.app.tempdir) / f"{STRIP}-{scene.name_full}.wav"
        shutil.move(work / "sound.wav", kept)
        return kept
    home.mkdir(exist_ok=True)
    stem = f"{pathlib.Path(bpy.data.filepath).stem}-{bpy.path.clean_name(scene.name)}"
    for name, ending in (("scene.json", ".json"), ("sound.wav", ".wav")):
        half = home / f".{stem}{ending}.part"
        shutil.move(work / name, half)
        os.replace(half, home / f"{stem}{ending}")
    return home / f"{stem}.wav"
