"""A mesh as Universal Scene Description, with the material UsdPreviewSurface.

Layout: the default prim is named after the file and contains the mesh and its material. The Y axis
points up, the unit is the metre. A specular level becomes the index of refraction with f0 = .04
level, in a texture where it varies: Blender and others do not support the specular workflow.

Reference: Pixar, "UsdPreviewSurface specification", version 2.6,
https://openusd.org/release/spec_usdpreviewsurface.html.

Limits: needs usd-core (the extra `usd`). USD has no tangents: programs compute them from the
texture coordinates.
"""

import os
import re
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ...errors import InputError
from ...extras import install_command
from ...imaging.srgb import share_codes
from ..mesh.result import MeshResult
from .textures import MeshTextures, plain_stem, refraction


def encode_usd(built: MeshResult, path: Path) -> dict[str, bytes]:
    """Encode a mesh.

    Parameters
    ----------
    built : MeshResult
    path : Path
        Of the file; its suffix is `.usd`, `.usda`, `.usdc` or `.usdz`.

    Returns
    -------
    dict of str to bytes
        Name and content of each file, that of `path` first. A `.usdz` contains its textures.

    Raises
    ------
    InputError
        If usd-core is not installed.
    """
    require_usd(path)
    from pxr import Sdf, UsdUtils

    name, packed = plain_stem(path), path.suffix.lower() == ".usdz"
    # USD does not mark names in an archive as UTF-8: some viewers would not find the textures.
    material = _Material.of(built, _identifier(name) if packed else name)
    with tempfile.TemporaryDirectory(prefix="isc-usd-") as place:
        folder = Path(place)
        for file, content in material.textures.files.items():
            (folder / file).write_bytes(content)
        scene = folder / f"scene{'.usdc' if packed else path.suffix.lower()}"
        _write_stage(built, material, scene, name)
        if packed:
            package = folder / "scene.usdz"
            if not UsdUtils.CreateNewUsdzPackage(Sdf.AssetPath(os.fspath(scene)), str(package)):
                raise InputError(f"{path}: usd-core cannot write the package: choose .usdc")
            return {path.name: package.read_bytes()}
        return {path.name: scene.read_bytes(), **material.textures.files}


def require_usd(path: Path) -> None:
    """Check that usd-core is installed.

    Parameters
    ----------
    path : Path
        The file to write, for the error message.

    Raises
    ------
    InputError
        If it is not.
    """
    try:
        import pxr.Usd  # noqa: F401
    except ImportError as error:
        raise InputError(
            f"{path}: USD needs usd-core: install it with `{install_command('usd')}`, or use "
            "--format glb"
        ) from error


@dataclass(frozen=True)
class _Material:
    """What the material refers to; `refraction` is the largest index of refraction, and `opacity`
    and `variation` of the index are files, or None.
    """

    textures: MeshTextures
    refraction: float
    opacity: str | None
    variation: str | None

    @staticmethod
    def of(built: MeshResult, name: str) -> "_Material":
        textures, variation = MeshTextures.of(built, name), built.gloss.variation
        opacity = None if built.alpha is None else textures.add("opacity", built.alpha)
        index = refraction(built.specular * (1.0 if variation is None else variation))
        largest, file = float(index.max()), None
        if variation is not None and largest > 1:
            file = textures.add("ior", share_codes((index - 1) / (largest - 1)))
        return _Material(textures, largest, opacity, file)


def _write_stage(built: MeshResult, material: _Material, path: Path, name: str) -> None:
    from pxr import Kind, Usd, UsdGeom

    stage = Usd.Stage.CreateNew(os.fspath(path))
    UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.y)
    UsdGeom.SetStageMetersPerUnit(stage, 1.0)
    root = UsdGeom.Xform.Define(stage, f"/{_identifier(name)}")
    stage.SetDefaultPrim(root.GetPrim())
    Usd.ModelAPI(root).SetKind(Kind.Tokens.component)
    mesh = _mesh(stage, f"{root.GetPath()}/mesh", built)
    _bind_material(stage, f"{root.GetPath()}/material", mesh, built, material)
    stage.GetRootLayer().Save()


def _identifier(name: str) -> str:
    """A name as USD allows: letters, digits and underscores."""
    word = re.sub(r"[^A-Za-z0-9_]", "_", name)
    return word if re.match(r"[A-Za-z_]", word) else f"_{word}"


def _mesh(stage: Any, path: str, built: MeshResult) -> Any:
    from pxr import Sdf, UsdGeom, Vt

    def vectors(values: Any, kind: Any) -> Any:
        return kind.FromNumpy(values.astype("float32"))

    geometry, mesh = built.mesh, UsdGeom.Mesh.Define(stage, path)
    faces = geometry.faces.astype("int32")
    points = vectors(geometry.vertices, Vt.Vec3fArray)
    mesh.CreatePointsAttr(points)
    mesh.CreateExtentAttr(UsdGeom.PointBased.ComputeExtent(points))
    mesh.CreateFaceVertexCountsAttr(Vt.IntArray(len(faces), 3))
    mesh.CreateFaceVertexIndicesAttr(Vt.IntArray.FromNumpy(faces.reshape(-1)))
    mesh.CreateNormalsAttr(vectors(geometry.vertex_normals, Vt.Vec3fArray))
    mesh.SetNormalsInterpolation(UsdGeom.Tokens.vertex)
    mesh.CreateSubdivisionSchemeAttr(UsdGeom.Tokens.none)
    mesh.CreateDoubleSidedAttr(True)
    coordinates = UsdGeom.PrimvarsAPI(mesh).CreatePrimvar(
        "st", Sdf.ValueTypeNames.TexCoord2fArray, UsdGeom.Tokens.vertex
    )
    coordinates.Set(vectors(geometry.uv, Vt.Vec2fArray))
    return mesh


def _bind_material(stage: Any, path: str, mesh: Any, built: MeshResult, given: _Material) -> None:
    from pxr import Gf, Sdf, UsdShade

    kinds, textures = Sdf.ValueTypeNames, given.textures
    material = UsdShade.Material.Define(stage, path)
    surface = UsdShade.Shader.Define(stage, f"{path}/surface")
    surface.CreateIdAttr("UsdPreviewSurface")
    surface.CreateInput("roughness", kinds.Float).Set(built.roughness)
    surface.CreateInput("metallic", kinds.Float).Set(built.options.metallic)
    place = UsdShade.Shader.Define(stage, f"{path}/coordinates")
    place.CreateIdAttr("UsdPrimvarReader_float2")
    place.CreateInput("varname", kinds.String).Set("st")
    place.CreateOutput("result", kinds.Float2)

    def texture(name: str, file: str, space: str, kind: Any, scale: float, bias: float) -> None:
        reader = UsdShade.Shader.Define(stage, f"{path}/{name}_texture")
        reader.CreateIdAttr("UsdUVTexture")
        reader.CreateInput("file", kinds.Asset).Set(Sdf.AssetPath(f"./{file}"))
        reader.CreateInput("sourceColorSpace", kinds.Token).Set(space)
        for axis in ("wrapS", "wrapT"):
            reader.CreateInput(axis, kinds.Token).Set("clamp")
        reader.CreateInput("scale", kinds.Float4).Set(Gf.Vec4f(scale, scale, scale, 1))
        reader.CreateInput("bias", kinds.Float4).Set(Gf.Vec4f(bias, bias, bias, 0))
        reader.CreateInput("st", kinds.Float2).ConnectToSource(place.ConnectableAPI(), "result")
        part = "r" if kind == kinds.Float else "rgb"
        reader.CreateOutput(part, kinds.Float if part == "r" else kinds.Float3)
        surface.CreateInput(name, kind).ConnectToSource(reader.ConnectableAPI(), part)

    texture("diffuseColor", textures.base_color, "sRGB", kinds.Color3f, 1, 0)
    if textures.normal:
        texture("normal", textures.normal, "raw", kinds.Normal3f, 2, -1)
    if given.opacity:
        texture("opacity", given.opacity, "raw", kinds.Float, 1, 0)
    if given.variation:
        texture("ior", given.variation, "raw", kinds.Float, given.refraction - 1, 1)
    else:
        surface.CreateInput("ior", kinds.Float).Set(given.refraction)
    material.CreateSurfaceOutput().ConnectToSource(surface.ConnectableAPI(), "surface")
    UsdShade.MaterialBindingAPI.Apply(mesh.GetPrim()).Bind(material)
