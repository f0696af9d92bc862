"""Expected numbers of shipped scenes from Mitsuba 3, an independent renderer.

    python tools/mitsuba_reference.py NAME ... [--spp 256] [--seeds 16] [--write]

Needs `pip install mitsuba==3.9.1` (and libLLVM: DRJIT_LIBLLVM_PATH) beside raytide. Each NAME (folder/scene) is
rendered with the path integrator, no Russian roulette, and a box filter; the means of the checks in its expected.toml
that have a standard error are printed, and stored with --write. Analytic shapes stay analytic; a plane becomes a large
rectangle. Not translated: glossy with a specular part, spot, thin lens, smooth normals.
"""

from __future__ import annotations

import argparse
import math
import sys
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parent))

from measure_expected import SCENES, checks_of, mean_over, scene_names, write_measured  # noqa: E402

PLANE_REACH = 1e4  # m; its rim is 0.2 mrad below the horizon, so checks leave that row out; 1e6 costs Mitsuba 1e-3


def rgb(value: Any) -> dict[str, Any]:
    return {"type": "rgb", "value": [float(v) for v in np.broadcast_to(value, 3)]}


def bsdf_of(material: Any) -> dict[str, Any]:
    match material.type:
        case "emissive":
            return {"type": "diffuse", "reflectance": rgb(0.0)}
        case "glossy" if material.specular > 0:
            raise SystemExit("material glossy is translated only where specular = 0")
        case "diffuse" | "glossy":
            inner = {"type": "diffuse", "reflectance": rgb(material.reflectance)}
        case "mirror":
            inner = {"type": "conductor", "material": "none", "specular_reflectance": rgb(material.reflectance)}
        case "rough_conductor":
            inner = {"type": "roughconductor", "distribution": "ggx", "alpha": material.roughness,
                     "eta": rgb(material.parameter("eta")), "k": rgb(material.parameter("k"))}
        case "dielectric":
            return {"type": "dielectric", "int_ior": material.ior, "ext_ior": material.exterior_ior}
        case other:
            raise SystemExit(f"material {other} is not translated")
    return {"type": "twosided", "inner": inner}


def shape_of(mi: Any, flat: Any, item: Any) -> Any:
    """One object as a Mitsuba shape (dictionary) or mesh (object)."""
    material = flat.materials[item.material]
    parts: dict[str, Any] = {"bsdf": bsdf_of(material)}
    if material.type == "emissive":
        parts["emitter"] = {"type": "area", "radiance": rgb(material.parameter("radiance"))}
    if item.shape < 0:
        return mesh_of(mi, flat, item, parts)
    shape = flat.shapes[item.shape]
    u, v, w = shape.axes
    if shape.kind == "plane":
        u, v = u * PLANE_REACH, v * PLANE_REACH
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = np.array([u, v, w]).T, shape.center
    kinds = {"plane": "rectangle", "rectangle": "rectangle", "disk": "disk", "box": "cube", "sphere": "sphere"}
    return {"type": kinds[shape.kind], "to_world": mi.ScalarTransform4f(matrix), **parts}


def mesh_of(mi: Any, flat: Any, item: Any, parts: dict[str, Any]) -> Any:
    faces = flat.triangles[item.first_triangle:item.first_triangle + item.triangle_count]
    used, index = np.unique(faces, return_inverse=True)
    properties = mi.Properties()
    properties["face_normals"] = True
    for name, part in parts.items():
        properties[name] = mi.load_dict(part)
    mesh = mi.Mesh(item.name, len(used), len(faces), props=properties)
    parameters = mi.traverse(mesh)
    parameters["vertex_positions"] = flat.vertices[used].astype(np.float32).ravel()
    parameters["faces"] = index.astype(np.uint32).ravel()
    parameters.update()
    return mesh


def light_of(light: Any) -> dict[str, Any]:
    match light.type:
        case "point":
            return {"type": "point", "position": list(light.position), "intensity": rgb(light.intensity)}
        case "directional":
            return {"type": "directional", "direction": list(light.direction), "irradiance": rgb(light.irradiance)}
        case "environment":
            return {"type": "constant", "radiance": rgb(np.multiply(light.radiance, light.scale))}
        case other:
            raise SystemExit(f"light {other} is not translated")


def camera_of(mi: Any, camera: Any) -> dict[str, Any]:
    to_world = mi.ScalarTransform4f().look_at(origin=list(camera.origin), target=list(camera.target),
                                              up=list(camera.up))
    width, height = camera.size
    film = {"type": "hdrfilm", "width": width, "height": height, "pixel_format": "rgb",
            "component_format": "float32", "rfilter": {"type": "box"}}
    if camera.type == "orthographic":
        half = camera.height / 2
        return {"type": "orthographic", "to_world": to_world @ mi.ScalarTransform4f().scale(
            [half * width / height, half * width / height, 1]), "film": film}
    if camera.type != "pinhole":
        raise SystemExit(f"camera {camera.type} is not translated")
    return {"type": "perspective", "fov": camera.fov, "fov_axis": "y", "to_world": to_world, "film": film}


def build(mi: Any, flat: Any) -> Any:
    """The Mitsuba scene of a raytide.scene FlatScene."""
    depth = flat.render.max_depth
    out: dict[str, Any] = {"type": "scene", "camera": camera_of(mi, flat.camera),
                           "integrator": {"type": "path", "max_depth": depth, "rr_depth": 1 << 20}}
    for item in flat.objects:
        out[f"object_{item.name}"] = shape_of(mi, flat, item)
    for name, light in zip(flat.light_names, flat.lights, strict=True):
        out[f"light_{name}"] = light_of(light)
    return mi.load_dict(out)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("names", nargs="+")
    parser.add_argument("--spp", type=int, default=256)
    parser.add_argument("--seeds", type=int, default=16)
    parser.add_argument("--variant", default="llvm_ad_rgb")
    parser.add_argument("--write", action="store_true")
    options = parser.parse_args()
    import mitsuba as mi
    import tomlkit

    import raytide as rt

    mi.set_variant(options.variant)
    source = f"Mitsuba {mi.__version__} {options.variant}, path, {options.seeds} seeds x {options.spp} spp"
    for name in scene_names(options.names):
        scene = build(mi, rt.load(SCENES / f"{name}.toml").flatten(share=False))
        images = np.stack([np.array(mi.render(scene, spp=options.spp, seed=1000 + seed))[..., :3]
                           for seed in range(options.seeds)])
        folder, stem = name.split("/")
        path = SCENES / folder / "expected.toml"
        document = tomlkit.parse(path.read_text(encoding="utf-8"))
        for check, old in zip(document[stem], checks_of(name), strict=True):
            means = mean_over(images, old)
            error = means.std(axis=0, ddof=1) / math.sqrt(len(means))
            print(f"{name} {old.get('pixels', 'all')} {means.mean(axis=0)} +- {error}, stored {old['value']}",
                  flush=True)
            if options.write and "standard_error" in old:
                write_measured(check, means, source)
        if options.write:
            path.write_text(tomlkit.dumps(document), encoding="utf-8")


if __name__ == "__main__":
    main()
