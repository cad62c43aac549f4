# SPDX-License-Identifier: BSD-3-Clause
"""COLMAP models, read back by COLMAP itself."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pycolmap
import pytest
from hypothesis import HealthCheck, given
from hypothesis import settings as hypothesis_settings
from hypothesis import strategies as st

from orbslam2py import CameraModel, DatasetError, MapFileError
from orbslam2py._arrays import ByteArray
from orbslam2py.maps import MapContents, export_colmap
from orbslam2py.maps.content_groups import LENS_SIZE, model_number_of
from orbslam2py.maps.reprojection import project_points
from support.made_up_map import (
    BF,
    CX,
    CY,
    FX,
    FY,
    HEIGHT,
    LENS,
    RATIONAL_LENS,
    WIDTH,
    made_up_map,
)

WIDE = (*LENS[:4], -0.03)
BINARY = pytest.mark.parametrize("binary", [True, False], ids=["binary", "text"])


def read(folder: Path) -> pycolmap.Reconstruction:
    return pycolmap.Reconstruction(str(folder / "sparse" / "0"))


def grey_images(keyframe_id: int) -> ByteArray:
    return np.full((HEIGHT, WIDTH), keyframe_id, np.uint8)


def check_against(contents: MapContents, model: pycolmap.Reconstruction) -> None:
    """Counts, poses, tracks and errors are those of the map."""
    keyframes, points = contents.keyframes, contents.points
    assert model.num_images() == model.num_reg_images() == len(keyframes)
    assert model.num_points3D() == len(points)
    assert model.compute_num_observations() == len(contents.observations)
    for row, number in enumerate(keyframes.ids.tolist()):
        image = model.images[number + 1]
        np.testing.assert_allclose(
            image.cam_from_world().matrix(), keyframes.T_cw[row, :3], atol=1e-12
        )
        assert image.name == f"keyframe_{number:06d}.png"
        seen, keypoints = contents.observations_in_keyframe(number)
        assert [image.points2D[k].point3D_id for k in keypoints] == (seen + 1).tolist()
        assert image.num_points2D() == len(keyframes.keypoints[keyframes.keypoints_of(row)])
        assert image.num_points3D == len(seen)
    for row, number in enumerate(points.ids.tolist()):
        point = model.points3D[number + 1]
        np.testing.assert_array_equal(point.xyz, points.positions[row])
        where, keypoints = contents.observations_of_point(number)
        track = [(one.image_id - 1, one.point2D_idx) for one in point.track.elements]
        assert track == list(zip(where.tolist(), keypoints.tolist(), strict=True))


def check_errors(model: pycolmap.Reconstruction, atol: float = 1e-6) -> float:
    """The errors in the file are what COLMAP itself computes; returns their mean."""
    written = {number: point.error for number, point in model.points3D.items()}
    mean = float(model.compute_mean_reprojection_error())
    model.update_point_3d_errors()
    for number, point in model.points3D.items():
        assert point.error == pytest.approx(written[number], abs=atol)
    assert mean == pytest.approx(float(model.compute_mean_reprojection_error()), abs=atol)
    return mean


@BINARY
@pytest.mark.parametrize(
    ("lens", "camera_model", "parameters"),
    [
        (None, "PINHOLE", ()),
        (LENS, "OPENCV", LENS[:4]),
        (WIDE, "FULL_OPENCV", (*WIDE, 0, 0, 0)),
        (RATIONAL_LENS, "FULL_OPENCV", RATIONAL_LENS),
    ],
)
def test_everything_is_read_back(
    tmp_path: Path,
    binary: bool,
    lens: tuple[float, ...] | None,
    camera_model: str,
    parameters: tuple[float, ...],
) -> None:
    contents = made_up_map(lens=lens, colours=True, noise=0.7)
    export_colmap(contents, tmp_path / "out", binary=binary)
    names = {path.suffix for path in (tmp_path / "out" / "sparse" / "0").iterdir()}
    assert names == ({".bin"} if binary else {".txt"})
    model = read(tmp_path / "out")
    check_against(contents, model)
    (camera,) = model.cameras.values()
    assert camera.model.name == camera_model
    assert (camera.width, camera.height) == (WIDTH, HEIGHT)
    np.testing.assert_allclose(camera.params, [FX, FY, CX + 0.5, CY + 0.5, *parameters])
    colours = contents.point_colours()
    assert colours is not None
    for row, number in enumerate(contents.points.ids.tolist()):
        np.testing.assert_array_equal(model.points3D[number + 1].color, colours[row])
    assert 0.5 < check_errors(model) < 1.5


@BINARY
@pytest.mark.parametrize("lens", [None, LENS, WIDE, RATIONAL_LENS])
def test_exact_projections_have_no_error(
    tmp_path: Path, binary: bool, lens: tuple[float, ...] | None
) -> None:
    """Half a pixel, a swapped axis or an inverted pose would show here."""
    export_colmap(made_up_map(lens=lens), tmp_path / "out", binary=binary)
    assert check_errors(read(tmp_path / "out")) < 1e-4


def test_a_grey_image_may_have_a_channel_of_its_own(tmp_path: Path) -> None:
    export_colmap(made_up_map(2), tmp_path / "one", images=lambda i: grey_images(i)[:, :, None])
    export_colmap(made_up_map(2), tmp_path / "none", images=grey_images)
    for path in sorted((tmp_path / "none" / "images").iterdir()):
        same = tmp_path / "one" / "images" / path.name
        assert same.read_bytes() == path.read_bytes()


@pytest.mark.parametrize("lens", [None, LENS, RATIONAL_LENS])
def test_with_images_the_camera_is_a_pinhole(
    tmp_path: Path, lens: tuple[float, ...] | None
) -> None:
    contents = made_up_map(lens=lens, depth=True)
    assert contents.cameras.bf[0] == BF
    export_colmap(contents, tmp_path / "out", images=grey_images)
    model = read(tmp_path / "out")
    check_against(contents, model)
    (camera,) = model.cameras.values()
    assert camera.model.name == "PINHOLE"
    assert check_errors(model) < 1e-4
    for image in model.images.values():
        written = cv2.imread(str(tmp_path / "out" / "images" / image.name), cv2.IMREAD_UNCHANGED)
        assert written.shape == (HEIGHT, WIDTH)
        assert written[HEIGHT // 2, WIDTH // 2] == image.image_id - 1


@pytest.mark.parametrize("lens", [LENS, RATIONAL_LENS])
def test_straight_lines_are_straight_in_the_images(tmp_path: Path, lens: tuple[float, ...]) -> None:
    """A dot drawn where the lens shows a point appears where the model says it is."""
    contents = made_up_map(n_keyframes=3, n_points=6, lens=lens, seed=3)
    keyframes = contents.keyframes

    def dotted(keyframe_id: int) -> ByteArray:
        image = np.zeros((HEIGHT, WIDTH, 3), np.uint8)
        row = keyframes.row_of(keyframe_id)
        _, numbers = contents.observations_in_keyframe(keyframe_id)
        for u, v in keyframes.raw_keypoints[keyframes.keypoints_of(row)][numbers]:
            centre = round(float(u) * 16), round(float(v) * 16)
            cv2.circle(image, centre, 3 * 16, (255, 80, 10), -1, cv2.LINE_AA, 4)
        return image

    export_colmap(contents, tmp_path / "out", images=dotted)
    model = read(tmp_path / "out")
    for image in model.images.values():
        pixels = cv2.imread(str(tmp_path / "out" / "images" / image.name))
        for point in image.points2D:
            if point.has_point3D():
                u, v = (int(value) for value in np.floor(point.xy))
                assert pixels[v, u].tolist() == [10, 80, 255]  # OpenCV reads BGR


def test_small_images_are_scaled_ones(tmp_path: Path) -> None:
    contents = made_up_map(noise=0.5)
    small = (HEIGHT // 2, WIDTH // 2)
    export_colmap(contents, tmp_path / "whole")
    export_colmap(contents, tmp_path / "half", images=lambda _: np.zeros(small, np.uint8))
    whole, half = check_errors(read(tmp_path / "whole")), check_errors(read(tmp_path / "half"))
    assert half == pytest.approx(whole / 2, rel=1e-6)
    (camera,) = read(tmp_path / "half").cameras.values()
    assert (camera.height, camera.width) == small


def test_keyframes_without_an_image_are_left_out(tmp_path: Path) -> None:
    contents = made_up_map(n_keyframes=4)
    export_colmap(
        contents,
        tmp_path / "out",
        images=lambda number: grey_images(number) if number < 2 else None,
    )
    model = read(tmp_path / "out")
    assert sorted(model.images) == [1, 2]
    seen = contents.observations.point[contents.observations.keyframe < 2]
    assert sorted(model.points3D) == (np.unique(seen) + 1).tolist()
    assert {one.image_id for p in model.points3D.values() for one in p.track.elements} == {1, 2}
    check_errors(model)


def test_names_of_images_elsewhere(tmp_path: Path) -> None:
    contents = made_up_map(n_keyframes=4)
    export_colmap(contents, tmp_path / "out", image_names={1: "rgb/a.png", 3: "rgb/b.png"})
    model = read(tmp_path / "out")
    assert {number: image.name for number, image in model.images.items()} == {
        2: "rgb/a.png",
        4: "rgb/b.png",
    }


@BINARY
@pytest.mark.parametrize("name", ["é/#1.png", Path("rgb/a.png")])
def test_any_name_of_a_file_elsewhere(tmp_path: Path, binary: bool, name: str | Path) -> None:
    export_colmap(made_up_map(), tmp_path / "out", image_names={1: name}, binary=binary)  # type: ignore[dict-item]
    (image,) = read(tmp_path / "out").images.values()
    assert image.name == str(name)


@pytest.mark.parametrize("name", ["a b.png", " a.png", "a.png ", "a\tb.png"])
def test_a_name_with_a_space_is_whole_or_refused(tmp_path: Path, name: str) -> None:
    """COLMAP reads its text files up to the next space."""
    export_colmap(made_up_map(), tmp_path / "out", image_names={1: name})
    (image,) = read(tmp_path / "out").images.values()
    assert image.name == name
    with pytest.raises(MapFileError, match=r"image_names\[1\] is .* space.*binary=True"):
        export_colmap(made_up_map(), tmp_path / "text", image_names={1: name}, binary=False)
    assert not (tmp_path / "text").exists()


def test_names_are_written_as_their_bytes(tmp_path: Path) -> None:
    """Bytes that are no UTF-8 stand in Python's names as surrogates."""
    for binary, file in ((True, "images.bin"), (False, "images.txt")):
        folder = tmp_path / file
        export_colmap(made_up_map(), folder, image_names={1: "\udcff.png"}, binary=binary)
        assert b"\xff.png" in (folder / "sparse" / "0" / file).read_bytes()


@hypothesis_settings(
    deadline=None, max_examples=15, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
@given(
    keyframes=st.integers(2, 9),
    points=st.integers(1, 60),
    seed=st.integers(0, 99),
    bent=st.booleans(),
    binary=st.booleans(),
)
def test_any_map(
    tmp_path: Path, keyframes: int, points: int, seed: int, bent: bool, binary: bool
) -> None:
    contents = made_up_map(keyframes, points + 20, seed=seed, lens=LENS if bent else None)
    export_colmap(contents, tmp_path / "out", binary=binary, replace=True)
    model = read(tmp_path / "out")
    check_against(contents, model)
    assert check_errors(model) < 1e-4


# ---- the folder ----------------------------------------------------------------------------------
def test_an_earlier_export_is_replaced_only_if_asked(tmp_path: Path) -> None:
    export_colmap(made_up_map(5), tmp_path / "out", images=grey_images)
    with pytest.raises(DatasetError, match=r"out is not empty.*\(--force, replace=True\)"):
        export_colmap(made_up_map(3), tmp_path / "out")
    assert read(tmp_path / "out").num_images() == 5
    export_colmap(made_up_map(3), tmp_path / "out", images=grey_images, replace=True)
    assert read(tmp_path / "out").num_images() == 3
    assert len(list((tmp_path / "out" / "images").iterdir())) == 3


def test_other_files_are_never_lost(tmp_path: Path) -> None:
    (tmp_path / "notes.txt").write_text("mine")
    with pytest.raises(DatasetError, match=r"holds other files \(notes.txt\)"):
        export_colmap(made_up_map(3), tmp_path, replace=True)
    assert [path.name for path in tmp_path.iterdir()] == ["notes.txt"]
    with pytest.raises(DatasetError, match="is not a folder"):
        export_colmap(made_up_map(3), tmp_path / "notes.txt", replace=True)


def test_no_images_at_all(tmp_path: Path) -> None:
    with pytest.raises(DatasetError, match="no keyframe has an image; give the sequence"):
        export_colmap(made_up_map(3), tmp_path / "out", images=lambda _: None)
    assert not list(tmp_path.iterdir())


# ---- fisheye lenses ------------------------------------------------------------------------------
KANNALA_BRANDT = (-0.02, 0.005, -0.003, 0.001)


def fisheye_map(model: str, lens: tuple[float, ...]) -> MapContents:
    contents = made_up_map()
    numbers = np.zeros((1, LENS_SIZE))
    numbers[0, : 4 + len(lens)] = (FX, FY, CX, CY, *lens)
    model_number = np.array([model_number_of(model)])
    return replace(contents, cameras=replace(contents.cameras, model=model_number, lens=numbers))


def test_a_fisheye_camera_keeps_its_model(tmp_path: Path) -> None:
    contents = fisheye_map("kannala_brandt", KANNALA_BRANDT)
    export_colmap(contents, tmp_path / "colmap")
    camera = read(tmp_path / "colmap").cameras[1]
    assert camera.model.name == "OPENCV_FISHEYE"
    np.testing.assert_allclose(camera.params, (FX, FY, CX + 0.5, CY + 0.5, *KANNALA_BRANDT))
    # COLMAP projects as we do.
    point = np.array([0.4, -0.3, 1.1])
    ours = CameraModel(
        "kannala_brandt", (FX, FY, CX, CY, *KANNALA_BRANDT), (WIDTH, HEIGHT)
    ).project([point])
    np.testing.assert_allclose(camera.img_from_cam(point), ours[0] + 0.5, atol=1e-6)


def seen_through(contents: MapContents) -> MapContents:
    """The map with the observed keypoints where the cameras show the points."""
    observations, keypoints = contents.observations, contents.keyframes.keypoints.copy()
    seer = np.searchsorted(contents.keyframes.ids, observations.keyframe)
    point = np.searchsorted(contents.points.ids, observations.point)
    flat = np.zeros(len(seer), bool)
    keypoints[contents.observed_keypoints] = project_points(contents, seer, point, flat)
    return replace(contents, keyframes=replace(contents.keyframes, keypoints=keypoints))


@pytest.mark.parametrize("field", [None, 40.0])
def test_images_of_another_lens_become_those_of_a_pinhole(
    tmp_path: Path, caplog: pytest.LogCaptureFixture, field: float | None
) -> None:
    contents = seen_through(fisheye_map("double_sphere", (-0.2, 0.6)))
    white = np.full((HEIGHT, WIDTH), 255, np.uint8)
    export_colmap(contents, tmp_path / "out", images=lambda _: white, field=field)
    assert "lens of the model double_sphere, which the format cannot hold" in caplog.text
    model = read(tmp_path / "out")
    camera = model.cameras[1]
    assert (camera.model.name, camera.width, camera.height) == ("PINHOLE", WIDTH, HEIGHT)
    wide = np.degrees(2 * np.arctan(WIDTH / 2 / camera.params[0]))
    assert 10 < wide <= 120
    if field is not None:
        assert wide == pytest.approx(40)
    n_points = 0
    for image in model.images.values():
        picture = cv2.imread(str(tmp_path / "out" / "images" / image.name), cv2.IMREAD_GRAYSCALE)
        assert picture is not None
        if field is None:
            assert picture.min() > 250, "no border is empty"
        for keypoint in image.points2D:
            if keypoint.has_point3D():
                n_points += 1
                position = model.points3D[keypoint.point3D_id].xyz
                expected = camera.img_from_cam(image.cam_from_world() * position)
                np.testing.assert_allclose(keypoint.xy, expected, atol=5e-3)
    assert n_points > 10


def test_the_field_of_the_images_is_checked(tmp_path: Path) -> None:
    contents = fisheye_map("double_sphere", (-0.2, 0.6))
    with pytest.raises(DatasetError, match="field of view of the images is 200; give degrees from"):
        export_colmap(contents, tmp_path / "out", images=lambda _: None, field=200.0)


def test_a_lens_that_colmap_does_not_know(tmp_path: Path) -> None:
    contents = fisheye_map("double_sphere", (-0.2, 0.6))
    with pytest.raises(DatasetError, match=r"double_sphere.*kannala_brandt.*give the images"):
        export_colmap(contents, tmp_path / "colmap")
    assert not (tmp_path / "colmap").exists()
