"""`rso-lidar models add`, `check` and `remove`: meshes, examined and put into the user's own library."""

import math
from pathlib import Path
from typing import Annotated, Literal, get_args

import typer

from rso_lidar.cli.models_show import ByMaterial, FacetPartsFile, list_own_models
from rso_lidar.cli.terminal import echo
from rso_lidar.errors import MeshError, did_you_mean
from rso_lidar.records import ObjectClass, ShapeFamily, Stabilisation
from rso_lidar.scene import MeshOptions, add_model, examine_file, own_folder, remove_model

MeshFile = Annotated[Path, typer.Argument(metavar="PATH", help="STL, OBJ, PLY, GLB, glTF or OFF; STEP or IGES.")]


def add(
    path: MeshFile,
    name: Annotated[str | None, typer.Option("--name", help="Name in scenarios (the file's name).")] = None,
    scale: Annotated[float | None, typer.Option("--scale", help="Metres in one unit of the file.")] = None,
    size_m: Annotated[float | None, typer.Option("--size-m", help="Longest side (m), instead of --scale.")] = None,
    y_up: Annotated[bool, typer.Option("--y-up", help="The file's y is up: turn it to z.")] = False,
    material: Annotated[str | None, typer.Option("--material", help="Material of all parts.")] = None,
    part_material: Annotated[
        list[str] | None,
        typer.Option("--part-material", metavar="PART=NAME", help="Material of one part; again for more."),
    ] = None,
    part_class: Annotated[
        list[str] | None,
        typer.Option("--part-class", metavar="PART=CLASS", help="Common class of one part; may be repeated."),
    ] = None,
    facet_parts: FacetPartsFile = None,
    by_material: ByMaterial = False,
    center_of_mass: Annotated[
        str | None, typer.Option("--center-of-mass", metavar="X,Y,Z", help="In metres, in the mesh's axes.")
    ] = None,
    object_class: Annotated[
        str | None,
        typer.Option(
            "--class",
            help=f"One of {', '.join(get_args(ObjectClass))}.",
            autocompletion=lambda: [*get_args(ObjectClass)],
        ),
    ] = None,
    subclass: Annotated[str | None, typer.Option("--subclass", help="Any word, such as relay_satellite.")] = None,
    shape: Annotated[
        str | None,
        typer.Option(
            "--shape",
            help=f"One of {', '.join(get_args(ShapeFamily))}.",
            autocompletion=lambda: [*get_args(ShapeFamily)],
        ),
    ] = None,
    stabilisation: Annotated[
        str | None,
        typer.Option(
            "--stabilisation",
            help=f"One of {', '.join(get_args(Stabilisation))}.",
            autocompletion=lambda: [*get_args(Stabilisation)],
        ),
    ] = None,
    rate_deg_s: Annotated[
        tuple[float, float] | None,
        typer.Option("--rate-deg-s", metavar="LOW HIGH", help="Usual body rates (deg/s), least and greatest."),
    ] = None,
    what: Annotated[str | None, typer.Option("--what", help="A line for the list.")] = None,
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Replace your own model of that name.")] = False,
) -> None:
    """Add a mesh to your own library. Values that are guessed are printed."""
    axes: Literal["z_up", "y_up"] = "y_up" if y_up else "z_up"
    wanted = MeshOptions(
        name=name,
        scale=scale,
        size_m=size_m,
        mesh_axes=axes,
        material=material,
        part_materials=_parse_pairs("--part-material", "NAME", "bus=mli_gold", part_material or []),
        part_classes=_parse_pairs("--part-class", "CLASS", "wing=solar_array", part_class or []),
        facet_parts=facet_parts,
        by_material=by_material,
        center_of_mass_m=_parse_point(center_of_mass),
        what=what,
        taxonomy={
            "object_class": _check_word("--class", object_class, ObjectClass),
            "subclass": subclass,
            "shape_family": _check_word("--shape", shape, ShapeFamily),
            "stabilisation": _check_word("--stabilisation", stabilisation, Stabilisation),
            "rate_deg_s": _parse_rates(rate_deg_s),
        },
    )
    entry, said = add_model(path, wanted, overwrite=overwrite)
    size = " x ".join(f"{side:.4g}" for side in entry.size_m)
    echo(f"{entry.name}: {size} m, {entry.facets:,} facets, {len(entry.parts)} part{'s' * (len(entry.parts) > 1)}")
    for line in said:
        echo(f"  {line}")
    echo(f'in {own_folder()}; in a scenario: model = "{entry.name}"')


def remove(
    name: Annotated[
        str, typer.Argument(metavar="NAME", help="A model of your own library.", autocompletion=list_own_models)
    ],
) -> None:
    """Remove a model from your own library."""
    echo(f"removed {remove_model(name)}")


def _parse_rates(ends: tuple[float, float] | None) -> tuple[float, float] | None:
    if ends is not None and not 0.0 <= ends[0] <= ends[1] < math.inf:
        raise MeshError(
            f"--rate-deg-s {ends[0]:g} {ends[1]:g}: is not a range; give the lowest rate, 0 or more, then the highest"
        )
    return ends


def _check_word(option: str, value: str | None, words: object) -> str | None:
    """Return the value of an option if it is allowed, or raise `MeshError`.

    Parameters
    ----------
    words : the `Literal` of allowed values
    """
    known = get_args(words)
    if value is not None and value not in known:
        raise MeshError(f"{option} {value}: unknown value{did_you_mean(value, known)} (known: {', '.join(known)})")
    return value


def _parse_pairs(option: str, value: str, example: str, texts: list[str]) -> dict[str, str]:
    """Return the values of an option that is given once for each part, by part."""
    pairs = {}
    for text in texts:
        part, equals, chosen = text.rpartition("=")
        if not equals or not part or not chosen:
            raise MeshError(f"{option} {text}: is not PART={value}; write for example {example}")
        pairs[part] = chosen
    return pairs


def _parse_point(text: str | None) -> tuple[float, float, float] | None:
    if text is None:
        return None
    try:
        x, y, z = (float(word) for word in text.split(","))
    except ValueError:
        raise MeshError(f"--center-of-mass {text}: is not X,Y,Z; write for example 0.1,0,-0.4") from None
    return x, y, z


def check(
    path: MeshFile,
    scale: Annotated[float | None, typer.Option("--scale", help="Metres in one unit of the file.")] = None,
) -> None:
    """Examine a mesh: units, holes, winding, strays, hidden parts, and repairs made on loading.

    PATH may also be the name of a model. Nothing is changed; any mesh that can be loaded can be simulated.
    """
    lines = examine_file(path, scale).lines()
    echo(f"{path}")
    for line in lines:
        echo(line)
