"""What Blender makes of a BVH or GLB file. For a Python that has bpy: look.py IN.bvh OUT.npz [OUT.png]

OUT.npz gets `positions` (frames, joints, 3) in Blender's units with y up, `names`, `fps` and `heights` (frames, 2), the lowest
and highest point of a skinned body, as Blender has them after its own import; OUT.png a picture of some frames side by side,
spheres at the joints and sticks for the bones, rendered on the CPU.
"""

from __future__ import annotations

import json
import sys

import bpy
import numpy as np
from mathutils import Matrix, Vector

MOST_FRAMES = 100  # looked at, from the first on
SHOWN = 5  # frames in the picture
COLOURS = ((0.1, 0.3, 0.7, 1), (0.8, 0.3, 0.1, 1), (0.2, 0.2, 0.2, 1))  # names with left, with right, all others


def open_bvh(file: str):
    """A scene with nothing but the file's armature; y up becomes z up, a centimetre 0.01 units: what the how-to says."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.ops.import_anim.bvh(
        filepath=file, axis_forward="-Z", axis_up="Y", global_scale=0.01, rotate_mode="NATIVE", update_scene_fps=True,
        update_scene_duration=True,
    )  # fmt: skip
    return next(thing for thing in bpy.data.objects if thing.type == "ARMATURE")


def open_glb(file: str):
    """The same of a GLB file; the scene first gets the file's rate, as Blender counts keys in frames."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    with open(file, "rb") as opened:
        opened.seek(12)
        fps = json.loads(opened.read(int.from_bytes(opened.read(4), "little") + 4)[4:])["asset"]["extras"]["fps"]
    bpy.context.scene.render.fps, bpy.context.scene.render.fps_base = round(fps), round(fps) / fps
    bpy.ops.import_scene.gltf(filepath=file)
    return next(thing for thing in bpy.data.objects if thing.type == "ARMATURE")


def bodies(armature) -> np.ndarray:
    """Lowest and highest point of the meshes that the armature moves, frame by frame."""
    scene = bpy.context.scene
    first, last = (round(frame) for frame in armature.animation_data.action.frame_range)
    found = []
    for frame in range(first, min(last, first + MOST_FRAMES - 1) + 1):
        scene.frame_set(frame)
        graph, heights = bpy.context.evaluated_depsgraph_get(), []
        for thing in bpy.data.objects:
            if thing.type == "MESH" and thing.find_armature() is armature:
                shown = thing.evaluated_get(graph)
                heights += [(shown.matrix_world @ vertex.co).z for vertex in shown.to_mesh().vertices]
        found.append([min(heights), max(heights)] if heights else [0.0, 0.0])
    return np.array(found)


def joints(armature) -> np.ndarray:
    """Heads of the bones in Blender's world, frame by frame."""
    scene = bpy.context.scene
    first, last = (round(frame) for frame in armature.animation_data.action.frame_range)
    frames = range(first, min(last, first + MOST_FRAMES - 1) + 1)
    places = np.zeros((len(frames), len(armature.pose.bones), 3))
    for i, frame in enumerate(frames):
        scene.frame_set(frame)
        places[i] = [(armature.matrix_world @ bone.matrix).translation for bone in armature.pose.bones]
    return places


def picture(places: np.ndarray, names: list[str], parents: list[int], file: str) -> None:
    """Some frames side by side, seen from the front."""
    size = np.ptp(places[0, :, 2])
    materials = [bpy.data.materials.new(str(i)) for i in range(3)]
    for material, colour in zip(materials, COLOURS, strict=True):
        material.diffuse_color = colour
        material.use_nodes = True
        material.node_tree.nodes["Principled BSDF"].inputs["Base Color"].default_value = colour
    chosen = np.linspace(0, len(places) - 1, SHOWN).astype(int)
    for i, frame in enumerate(chosen):
        pose = places[frame] - places[frame, 0] + [0.75 * size * (i - (SHOWN - 1) / 2), 0, 0]
        for joint, parent in enumerate(parents):
            is_left, is_right = "left" in names[joint].lower(), "right" in names[joint].lower()
            material = materials[0 if is_left else 1 if is_right else 2]
            bpy.ops.mesh.primitive_uv_sphere_add(radius=0.02 * size, location=pose[joint], segments=12, ring_count=8)
            bpy.context.object.data.materials.append(material)
            if parent >= 0 and np.linalg.norm(pose[joint] - pose[parent]) > 1e-3 * size:
                stick(Vector(pose[parent]), Vector(pose[joint]), 0.01 * size, material)
    render(size, file)


def stick(start: Vector, end: Vector, radius: float, material) -> None:
    """A cylinder from one point to another."""
    bpy.ops.mesh.primitive_cylinder_add(radius=radius, depth=(end - start).length, vertices=10)
    turn = Vector((0, 0, 1)).rotation_difference(end - start).to_matrix().to_4x4()
    bpy.context.object.matrix_world = Matrix.Translation((start + end) / 2) @ turn
    bpy.context.object.data.materials.append(material)


def render(size: float, file: str) -> None:
    """With Cycles, which needs no graphics card, from the side to which BVH bodies face."""
    scene = bpy.context.scene
    camera = bpy.data.objects.new("camera", bpy.data.cameras.new("camera"))
    camera.data.type, camera.data.ortho_scale = "ORTHO", 4.0 * size
    camera.data.clip_end = 100 * size
    camera.location, camera.rotation_euler = (0, -10 * size, 0), (np.pi / 2, 0, 0)
    scene.collection.objects.link(camera)
    sun = bpy.data.objects.new("sun", bpy.data.lights.new("sun", "SUN"))
    sun.data.energy, sun.rotation_euler = 3.0, (0.8, 0.3, 0.0)
    scene.collection.objects.link(sun)
    scene.world = bpy.data.worlds.new("world")
    scene.world.use_nodes = True
    scene.world.node_tree.nodes["Background"].inputs["Color"].default_value = (1, 1, 1, 1)
    scene.camera, scene.render.engine, scene.cycles.device, scene.cycles.samples = camera, "CYCLES", "CPU", 8
    scene.view_settings.view_transform = "Standard"
    scene.render.resolution_x, scene.render.resolution_y, scene.render.filepath = 960, 360, file
    bpy.ops.render.render(write_still=True)


def main(source: str, target: str, image: str | None = None) -> None:
    armature = open_glb(source) if source.endswith(".glb") else open_bvh(source)
    places, bones = joints(armature), list(armature.pose.bones)
    names = [bone.name for bone in bones]
    parents = [bones.index(bone.parent) if bone.parent else -1 for bone in bones]
    fps = bpy.context.scene.render.fps / bpy.context.scene.render.fps_base
    np.savez(
        target, positions=places[:, :, [0, 2, 1]] * [1, 1, -1], names=np.array(names), fps=fps, heights=bodies(armature)
    )  # fmt: skip
    if image is not None:
        picture(places, names, parents, image)


if __name__ == "__main__":
    main(*sys.argv[1:])
