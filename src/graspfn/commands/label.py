"""`graspfn label`."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import typer

from graspfn.commands.check import problems
from graspfn.commands.ending import BAD_INPUT, end_at
from graspfn.params import ParameterError, read_yaml, validate


def label(
    mesh: Annotated[Path, typer.Argument(help="A .off .obj .stl .ply .glb or .gltf file, in metres.", metavar="MESH")],
    out: Annotated[Path | None, typer.Option(help="Folder to write to; ./NAME-labels if not given.")] = None,
    seed: Annotated[
        int | None, typer.Option(help="Of the drop and the attempts; that of params.yaml if not given.")
    ] = None,
    size: Annotated[float | None, typer.Option(metavar="CM", help="Scale the mesh to this largest extent.")] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print the account as JSON.")] = False,
) -> None:
    """Settle and label one mesh with the physics of params.yaml.

    For example: graspfn label mug.stl --size 10
    """
    end_at(problems(), BAD_INPUT)
    from graspfn.commands.label_mesh import label_mesh, table  # DART is slow to import, and may not load
    from graspfn.meshes.errors import MeshError
    from graspfn.workflow.parallel import ClusterError

    params = validate(read_yaml(Path("params.yaml")))
    out, seed = out or Path(f"{mesh.stem}-labels"), params.seed if seed is None else seed
    try:
        account = label_mesh(mesh, out, params, seed, size)
    except (ParameterError, MeshError, ClusterError) as error:
        end_at([str(error)], BAD_INPUT)
    typer.echo(json.dumps(account) if as_json else table(account))
