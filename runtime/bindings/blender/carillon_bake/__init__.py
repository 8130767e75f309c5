"""Blender add-on: the sound and the motion of objects, computed by the programs of Carillon.

Registers the operator `carillon.bake`, properties `carillon_*` of objects, materials and scenes, and panels: docs/howto/blender.md.
"""
import time

import bpy

from . import bake

bl_info = {
    "name": "Carillon",
    "author": "The authors of Carillon",
    "version": (0, 3, 0),
    "blender": (3, 4, 0),
    "location": "Properties > Scene, Object and Material > Carillon",
    "description": "Bakes falls of objects into keyframes and their sound into the sequencer",
    "category": "Physics",
}

STEP_S = 0.1  # of the timer of a bake that shows its progress

OBJECT = {
    "carillon_body": bpy.props.EnumProperty(
        name="Body",
        items=[
            ("AUTO", "As rigid body", "Active or passive as the object's rigid body, and no body without one"),
            ("ACTIVE", "Active", "Moves and sounds"),
            ("PASSIVE", "Passive", "Stays where it is, and sounds"),
            ("NONE", "None", "Neither moves nor sounds"),
        ],
        default="AUTO",
        description="Part of this object in a bake",
    ),
    "carillon_material": bpy.props.StringProperty(name="Material", description="Material of Carillon, instead of those of the slots"),
    "carillon_wall_m": bpy.props.FloatProperty(
        name="Wall", min=0, precision=4, description="Thickness of a hollow object [m], within its surface; 0: solid, as modelled"
    ),
    "carillon_velocity": bpy.props.FloatVectorProperty(
        name="Velocity", subtype="VELOCITY", description="At the first frame, along the world's axes"
    ),
    "carillon_angular_velocity": bpy.props.FloatVectorProperty(
        name="Angular velocity", description="At the first frame [rad/s], about the world's axes"
    ),
    "carillon_restitution": bpy.props.FloatProperty(
        name="Restitution", min=0, max=1, default=0.5, description="Without a rigid body, which has its own"
    ),
    "carillon_friction": bpy.props.FloatProperty(
        name="Friction", min=0, max=10, default=0.4, description="Without a rigid body, which has its own"
    ),
}
MATERIAL = {
    "carillon_material": bpy.props.StringProperty(
        name="Material", description="Material of Carillon, such as glass, brass, oak; empty: the one called like this material"
    )
}
SCENE = {
    "carillon_accuracy_cents": bpy.props.FloatProperty(
        name="Accuracy", min=0, max=1200, description="Largest error of a frequency [cents]; 0: a preview, which is faster"
    )
}


class CarillonPreferences(bpy.types.AddonPreferences):
    bl_idname = __package__
    __annotations__ = {
        "programs": bpy.props.StringProperty(
            name="Programs", subtype="DIR_PATH", description="Folder of carillon and carillon-render, if not on the PATH"
        )
    }

    def draw(self, _context):
        self.layout.prop(self, "programs")


def find_folder(context):
    """Folder of the programs, or ""."""
    addon = context.preferences.addons.get(__package__)
    return bpy.path.abspath(addon.preferences.programs) if addon else ""


class CARILLON_OT_bake(bpy.types.Operator):
    """Simulate the bodies of the scene with Carillon: keyframes, and their sound as a strip of the sequencer"""

    bl_idname = "carillon.bake"
    bl_label = "Bake with Carillon"
    bl_options = {"REGISTER", "UNDO"}

    _steps = _timer = None

    def execute(self, context):
        """Waits for the result: for scripts."""
        self._steps = bake.bake(context, find_folder(context))
        while (done := self._advance(context)) is None:
            time.sleep(0.02)
        return done

    def invoke(self, context, _event):
        if bpy.app.background:
            return self.execute(context)
        self._steps = bake.bake(context, find_folder(context))
        self._timer = context.window_manager.event_timer_add(STEP_S, window=context.window)
        context.window_manager.progress_begin(0, 100)
        context.window_manager.modal_handler_add(self)
        return {"RUNNING_MODAL"}

    def modal(self, context, event):
        if event.type == "ESC":
            self.report({"INFO"}, "Carillon: cancelled; nothing was changed")
            return self._finish(context, {"CANCELLED"})
        if event.type != "TIMER":
            return {"RUNNING_MODAL"}  # the scene stays as it is
        try:
            done = self._advance(context)
        except Exception:
            self._finish(context, {"CANCELLED"})
            raise
        return {"RUNNING_MODAL"} if done is None else self._finish(context, done)

    def cancel(self, context):
        self._finish(context, {"CANCELLED"})

    def _advance(self, context):
        """One step: None, or the result of the operator."""
        try:
            share, text = next(self._steps)
        except StopIteration as end:
            for note in end.value.notes:
                self.report({"WARNING"}, f"Carillon: {note}")
            self.report({"INFO"}, f"Carillon: {end.value.summary}")
            return {"FINISHED"}
        except bake.BakeError as error:
            self.report({"ERROR"}, f"Carillon: {error}")
            return {"CANCELLED"}
        if self._timer is not None:
            context.window_manager.progress_update(100 * share)
            context.workspace.status_text_set(f"Carillon: {text} ({100 * share:.0f} %). Esc cancels")
        return None

    def _finish(self, context, result):
        self._steps.close()  # ends a program that still runs
        context.window_manager.event_timer_remove(self._timer)
        context.window_manager.progress_end()
        context.workspace.status_text_set(None)
        return result


class CarillonPanel:
    bl_label = "Carillon"
    bl_space_type = "PROPERTIES"
    bl_region_type = "WINDOW"
    bl_options = {"DEFAULT_CLOSED"}

    def draw_properties(self, owner, names):
        self.layout.use_property_split = True
        for name in names:
            self.layout.prop(owner, name)


class CARILLON_PT_scene(CarillonPanel, bpy.types.Panel):
    bl_context = "scene"

    def draw(self, context):
        self.draw_properties(context.scene, SCENE)
        self.layout.operator("carillon.bake")


class CARILLON_PT_object(CarillonPanel, bpy.types.Panel):
    bl_context = "object"

    @classmethod
    def poll(cls, context):
        return context.object is not None and context.object.type == "MESH"

    def draw(self, context):
        body = context.object
        has_own = body.rigid_body is None
        self.draw_properties(body, [name for name in OBJECT if has_own or name not in ("carillon_restitution", "carillon_friction")])


class CARILLON_PT_material(CarillonPanel, bpy.types.Panel):
    bl_context = "material"

    @classmethod
    def poll(cls, context):
        return context.material is not None

    def draw(self, context):
        self.draw_properties(context.material, MATERIAL)


CLASSES = (CarillonPreferences, CARILLON_OT_bake, CARILLON_PT_scene, CARILLON_PT_object, CARILLON_PT_material)
OWNERS = ((bpy.types.Object, OBJECT), (bpy.types.Material, MATERIAL), (bpy.types.Scene, SCENE))


def register():
    for one in CLASSES:
        bpy.utils.register_class(one)
    for owner, properties in OWNERS:
        for name, value in properties.items():
            setattr(owner, name, value)


def unregister():
    for owner, properties in OWNERS:
        for name in properties:
            delattr(owner, name)
    for one in reversed(CLASSES):
        bpy.utils.unregister_class(one)
