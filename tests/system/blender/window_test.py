#!/usr/bin/python3
"""The add-on in Blender with a window, on a virtual screen: Esc ends a bake and leaves nothing, and the next one ends with a strip.

usage: window_test.py ADDON.zip      finds the programs in $CARILLON_BIN_DIR; exits 77 (skipped) without Blender or xvfb-run
"""
import os
import pathlib
import sys
import time
import traceback

try:
    import bpy
except ImportError:
    bpy = None

if bpy is None:
    from launch import start

    sys.exit(start(__file__, *sys.argv[1:], has_window=True))

ADDON, FOLDER = sys.argv[-2], pathlib.Path(sys.argv[-1])
LIMIT_S = 240


def make_scene():
    bpy.ops.preferences.addon_install(filepath=ADDON)
    bpy.ops.preferences.addon_enable(module="carillon_bake")
    for item in list(bpy.data.objects):
        bpy.data.objects.remove(item)
    bpy.ops.mesh.primitive_cube_add(size=0.05, location=(0, 0, 0.1))
    box = bpy.context.object
    box.name, box.carillon_body, box.carillon_material = "Box", "ACTIVE", "glass"
    bpy.context.scene.frame_end = 10
    bpy.ops.wm.save_as_mainfile(filepath=str(FOLDER / "scene.blend"))


def count_strips():
    editor = bpy.context.scene.sequence_editor
    return len(editor.sequences_all) if editor else 0


def act():
    """What a user does: yields the seconds to wait."""
    window = bpy.context.window_manager.windows[0]
    with bpy.context.temp_override(window=window):
        make_scene()
        yield 0.5
        (FOLDER / "slow").touch()
        assert bpy.ops.carillon.bake("INVOKE_DEFAULT") == {"RUNNING_MODAL"}
    solves, begin = FOLDER / "solves", time.monotonic()
    while not solves.exists():
        assert time.monotonic() - begin < LIMIT_S, "nothing is solved"
        yield 0.2
    window.event_simulate(type="ESC", value="PRESS", x=10, y=10)
    yield 1.0
    pid = solves.read_text().split()[-1]
    while os.path.exists(f"/proc/{pid}"):
        assert time.monotonic() - begin < LIMIT_S, "the solver still runs"
        yield 0.2
    (FOLDER / "slow").unlink()
    box = bpy.data.objects["Box"]
    left = [file.name for file in (FOLDER / "tmp").iterdir() if file.name.startswith("carillon")]
    assert (count_strips(), box.animation_data, left) == (0, None, []), left
    assert not list((FOLDER / "carillon").glob("*.wav"))
    with bpy.context.temp_override(window=window):
        assert bpy.ops.carillon.bake("INVOKE_DEFAULT") == {"RUNNING_MODAL"}
    while count_strips() == 0:
        assert time.monotonic() - begin < LIMIT_S, "no strip"
        yield 0.2
    assert len(box.animation_data.action.fcurves[0].keyframe_points) == 10


ACTS = act()


def step():
    try:
        return next(ACTS)
    except StopIteration:
        code = 0
    except Exception:
        traceback.print_exc()
        code = 1
    sys.stdout.flush()
    os._exit(code)


bpy.app.timers.register(step, first_interval=0.5)
