"""The bodies of a Blender scene: surfaces in metres, materials by slot, places.

Lengths of Blender times the scene's unit scale are metres. A surface is in the axes of its object, with the object's scale applied.
"""
import dataclasses

import bmesh
import mathutils
import numpy

FLAT_M = 1e-6  # height of a floor's surface
MAX_NAME_BYTES = 200


class BakeError(Exception):
    """One sentence for the user, with the object's name and the correction."""


@dataclasses.dataclass
class Body:
    item: object  # bpy.types.Object
    is_active: bool
    material: str
    points_m: numpy.ndarray  # (V, 3)
    triangles: numpy.ndarray  # (T, 3)
    place_m: tuple  # of the object's origin
    turn: mathutils.Quaternion
    stretch: mathutils.Matrix  # 3 x 3: axes of the turned object to its mesh; scale, with what its parents add

    @property
    def name(self):
        return self.item.name


@dataclasses.dataclass
class Floor:
    name: str
    height_m: float
    material: str
    restitution: float
    friction: float


def find_part(item):
    """ "ACTIVE", "PASSIVE" or None."""
    if item.type != "MESH" or item.carillon_body == "NONE":
        return None
    if item.carillon_body != "AUTO":
        return item.carillon_body
    return item.rigid_body.type if item.rigid_body else None


def find_surface_values(item):
    """Restitution and friction."""
    own = item.rigid_body
    return (own.restitution, own.friction) if own else (item.carillon_restitution, item.carillon_friction)


def find_material(item, mesh, known):
    """The material of Carillon that the faces of an object have. `known`: every name in small letters -> material."""

    def find(word, place):
        name = known.get(word.strip().lower())
        if name is None:
            raise BakeError(f'object {item.name}: {place}: there is no material "{word}"; `carillon materials` lists them')
        return name

    if item.carillon_material:
        return find(item.carillon_material, "Carillon > Material")
    found, seen = {}, []
    for index in sorted({polygon.material_index for polygon in mesh.polygons}):
        material = mesh.materials[index] if index < len(mesh.materials) else None
        if material is None:
            continue
        seen.append(material.name)
        if material.carillon_material:
            found[find(material.carillon_material, f"material {material.name}")] = material.name
        elif (name := known.get(material.name.split(".")[0].strip().lower())) is not None:
            found[name] = material.name
    if len(found) > 1:
        raise BakeError(
            f"object {item.name}: its faces are of {' and '.join(sorted(found))}; separate it by material (P in edit mode), "
            "or give the object one material (Object > Carillon)"
        )
    if not found:
        wrong = f"no material of Carillon is called {' or '.join(seen)}" if seen else "it has no material"
        raise BakeError(f"object {item.name}: {wrong}; name the slot's material glass, steel, oak..., or set Material > Carillon")
    return next(iter(found))


def check_closed(item, work):
    """Throws for a surface that encloses no volume; returns triangles facing outward."""
    if not work.faces:
        raise BakeError(f"object {item.name}: its mesh has no faces; give it some, or set Carillon > Body to None")
    bad = [edge for edge in work.edges if not edge.is_manifold]
    if bad:
        where = item.matrix_world @ ((bad[0].verts[0].co + bad[0].verts[1].co) / 2)
        raise BakeError(
            f"object {item.name}: its mesh is not closed: {len(bad)} edges have not two faces, one near "
            f"({where.x:.3g}, {where.y:.3g}, {where.z:.3g}); select them in edit mode (Select > All by Trait > Non Manifold) and fill "
            "the holes, or give a sheet thickness with the Solidify modifier"
        )
    bmesh.ops.triangulate(work, faces=work.faces)
    bmesh.ops.recalc_face_normals(work, faces=work.faces)


def split_transform(item, unit):
    """Place [m], rotation, and the 3 x 3 rest of an object's matrix in the world.

    The rest is the same at every place and rotation, to the bit, so that a second bake finds its banks.
    """
    matrix = item.matrix_world
    if item.parent is None:
        stretch = mathutils.Matrix.Diagonal(item.scale)
    else:
        own = matrix.decompose()[1].to_matrix().inverted() @ matrix.to_3x3()
        stretch = mathutils.Matrix([[round(x, 6) for x in row] for row in own])
    if abs(stretch.determinant()) < 1e-12:
        raise BakeError(f"object {item.name}: its scale is 0; give it one")
    turn = (matrix.to_3x3() @ stretch.inverted()).to_quaternion()
    turn.normalize()
    return tuple(unit * x for x in matrix.translation), turn, stretch


def find_flat_height(item, mesh, unit):
    """The height [m] of a level mesh; None for another."""
    if not mesh.vertices:
        return None
    heights = [unit * (item.matrix_world @ vertex.co).z for vertex in mesh.vertices]
    return sum(heights) / len(heights) if max(heights) - min(heights) <= FLAT_M else None


def collect(context, known):
    """(bodies, floor or None) of the scene as evaluated at its current frame."""
    scene = context.scene
    unit = scene.unit_settings.scale_length
    graph = context.evaluated_depsgraph_get()
    bodies, floor = [], None
    for item in sorted(scene.objects, key=lambda one: one.name):
        part = find_part(item)
        if part is None or item.hide_render:
            continue
        is_active = part == "ACTIVE"
        if is_active:
            check_movable(item)
        mesh = item.evaluated_get(graph).to_mesh()
        try:
            material = find_material(item, mesh, known)
            height = None if is_active else find_flat_height(item, mesh, unit)
            if height is not None:
                if floor:
                    raise BakeError(f"object {item.name}: {floor.name} is a floor already; make one of them a box, or no body")
                floor = Floor(item.name, height, material, *find_surface_values(item))
                continue
            work = bmesh.new()
            try:
                work.from_mesh(mesh)
                check_closed(item, work)
                work.verts.index_update()
                points = numpy.array([vertex.co for vertex in work.verts], float)
                triangles = numpy.array([[vertex.index for vertex in face.verts] for face in work.faces])
            finally:
                work.free()
        finally:
            item.evaluated_get(graph).to_mesh_clear()
        place, turn, stretch = split_transform(item, unit)
        if stretch.determinant() < 0:
            triangles = triangles[:, ::-1]
        points = unit * points @ numpy.array(stretch).T
        bodies.append(Body(item, is_active, material, points, triangles, place, turn, stretch))
    return bodies, floor


def check_movable(item):
    """Throws for an active object whose pose keyframes of its own cannot set."""
    if item.library or item.override_library:
        raise BakeError(f"object {item.name} is linked from another file and cannot be moved; make it local (Object > Relations)")
    if any(not one.mute for one in item.constraints):
        raise BakeError(f"object {item.name} has constraints, which would move it away from its keyframes; apply or disable them")
    if any(item.delta_location) or tuple(item.delta_rotation_euler) != (0, 0, 0) or tuple(item.delta_scale) != (1, 1, 1):
        raise BakeError(f"object {item.name} has delta transforms; apply them (Object > Apply > Apply Deltas)")
    if len(item.name.encode()) > MAX_NAME_BYTES:
        raise BakeError(f"object {item.name}: its name is too long; give at most {MAX_NAME_BYTES} bytes")
