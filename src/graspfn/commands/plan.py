"""`graspfn plan`: its options; `commands/planned.py` does the work."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Annotated

import typer

from graspfn.commands.ending import BAD_INPUT, InputError, end_at

METHODS, UNITS = "robust, best or centroid", "mm, 0.1mm or m"


def plan(
    images: Annotated[
        list[Path], typer.Argument(metavar="IMAGE...", help="Depth images: .png (16 bit) .tiff .npy .pcd .mcap")
    ],
    model: Annotated[
        Path | None,
        typer.Option(metavar="MODEL", help="Its folder, or mico-fcn (if not given) or franka-fcn, which come along."),
    ] = None,
    camera: Annotated[
        Path | None, typer.Option(metavar="FILE", help="CameraInfo in YAML; not needed for .pcd and .mcap.")
    ] = None,
    fx: Annotated[float | None, typer.Option(help="Instead of --camera: focal lengths and principal point.")] = None,
    fy: Annotated[float | None, typer.Option()] = None,
    cx: Annotated[float | None, typer.Option()] = None,
    cy: Annotated[float | None, typer.Option()] = None,
    depth_unit: Annotated[
        str | None, typer.Option(metavar="UNIT", help=f"{UNITS}; mm for whole numbers, else m, if not given.")
    ] = None,
    topic: Annotated[str | None, typer.Option(help="Of the images in an .mcap; the last is planned on.")] = None,
    camera_pose: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="Camera to table, 4 x 4; else the table's origin is on the optical axis."),
    ] = None,
    sigma_uv_mm: Annotated[float | None, typer.Option(metavar="MM", help="Std of where the gripper arrives.")] = None,
    sigma_theta_deg: Annotated[float | None, typer.Option(metavar="DEG", help="Std of its angle.")] = None,
    covariance: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="Of (u, v, theta) instead: 3 x 3, m and rad; or what `graspfn logs` wrote."),
    ] = None,
    method: Annotated[str, typer.Option(help=METHODS)] = "robust",
    roi: Annotated[str | None, typer.Option(metavar="X,Y,W,H", help="Only these pixels may show the object.")] = None,
    mask: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Only where this image is not 0 may the object be.")
    ] = None,
    robot_from_gripper: Annotated[
        Path | None, typer.Option(metavar="FILE", help="The gripper in the robot's frame when it saw the image.")
    ] = None,
    gripper_from_camera: Annotated[
        Path | None, typer.Option(metavar="FILE", help="The camera in the gripper's frame: hand-eye calibration.")
    ] = None,
    min_score: Annotated[float, typer.Option(help="No grasp if it promises less.")] = 0.0,
    as_json: Annotated[bool, typer.Option("--json", help="A line of JSON for each image.")] = False,
    figure: Annotated[
        Path | None, typer.Option(metavar="OUT.png", help="Draw the plan; of several images, OUT-IMAGE.png.")
    ] = None,
) -> None:
    """Plan a grasp on a depth image. Ends with 0 for a grasp, 3 for none, 2 for bad input.

    For example: graspfn plan mug.png --camera camera_info.yaml --sigma-uv-mm 5 --sigma-theta-deg 10
    """
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # small sums: threads would wait longer than they add
    from graspfn.commands import planned  # what plans is slow to import

    try:
        request = planned.Request(
            model=planned.checked_model(model),
            camera=planned.camera_of(camera, {"--fx": fx, "--fy": fy, "--cx": cx, "--cy": cy}),
            unit=planned.unit_of(depth_unit),
            topic=topic,
            T_world_camera=planned.pose_of(planned.transform_in(camera_pose, "--camera-pose")),
            uncertainty=planned.uncertainty_of(
                sigma_uv_mm, sigma_theta_deg, planned.covariance_in(covariance), needed=method == "robust"
            ),
            method=planned.method_of(method),
            roi=planned.roi_of(roi),
            mask=planned.mask_of(mask),
            frames=planned.frames_of(
                planned.transform_in(robot_from_gripper, "--robot-from-gripper"),
                planned.transform_in(gripper_from_camera, "--gripper-from-camera"),
            ),
            min_score=planned.share("--min-score", min_score),
            figure=planned.figure_of(figure, images),
        )
    except InputError as error:
        end_at([str(error)], BAD_INPUT)
    raise typer.Exit(planned.plan_all(images, request, as_json))
