# SPDX-License-Identifier: BSD-3-Clause
"""Synthetic images through any camera model."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

import orbslam2py as orb
from orbslam2py.cli.app import app
from orbslam2py.errors import SettingsError
from orbslam2py.settings import CameraSettings
from orbslam2py.synthetic import SyntheticOptions, SyntheticSequence
from support.lenses import DISTORTED, FISHEYE, VERY_WIDE

PINHOLE = CameraSettings(fx=200, fy=200, cx=159.5, cy=119.5, width=320, height=240)


def sequence(lens: CameraSettings | None, **options: object) -> SyntheticSequence:
    return SyntheticSequence(
        SyntheticOptions(world="room", sensor="rgbd", frames=4, lens=lens, **options)  # type: ignore[arg-type]
    )


def test_through_a_pinhole_it_is_the_image_of_the_renderer() -> None:
    through, plain = sequence(PINHOLE), sequence(None, size=(320, 240))
    plain_images, images = plain.load(1), through.load(1)
    # The renderer's own focal length is 0.625 times the width, as that of PINHOLE.
    difference = np.abs(images.image.astype(float) - plain_images.image.astype(float))
    assert np.mean(difference) < 3
    assert images.depth is not None and plain_images.depth is not None
    near = np.abs(images.depth.astype(float) - plain_images.depth) < 0.02 * plain_images.depth
    assert np.mean(near) > 0.98


@pytest.mark.parametrize(
    "lens",
    [FISHEYE, DISTORTED, VERY_WIDE],
    ids=["fisheye", "distorted", "very wide"],
)
def test_a_pixel_shows_what_lies_on_its_ray(lens: CameraSettings) -> None:
    wide = sequence(lens)
    T_wc = wide.T_wc(2)
    image, depth = wide.load(2).image, wide.exact_depth(2)
    model = lens.camera_model(
        *wide.camera.camera_model(lens.width or 0, lens.height or 0).image_size
    )
    random = np.random.default_rng(1)
    pixels = random.uniform(10, 230, (300, 2))
    rays = np.asarray(model.unproject(pixels))
    at = np.rint(pixels).astype(int)
    z = depth[at[:, 1], at[:, 0]].astype(float)
    use = np.isfinite(rays).all(axis=1) & (z > 0.2)
    assert np.count_nonzero(use) > 100
    points = rays[use] * (z[use] / rays[use, 2])[:, None]
    # A pinhole that looks where the point is sees it at that distance, and as bright.
    camera = sequence(None, size=(161, 161))
    greys, distances = [], []
    for point in points[:12]:
        forward = point / np.linalg.norm(point)
        right = np.cross([0.0, 1.0, 0.0], forward)
        right /= np.linalg.norm(right)
        T_cp = np.eye(4)
        T_cp[:3, :3] = np.stack([right, np.cross(forward, right), forward], axis=1)
        seen = camera.view(T_wc @ T_cp)
        assert seen.depth is not None
        distances.append(seen.depth[80, 80] / 5000.0)
        greys.append(float(seen.image[78:83, 78:83].mean()))
    expected = np.linalg.norm(points[:12], axis=1)
    assert np.median(np.abs(np.array(distances) - expected) / expected) < 0.01
    own = [float(image[y - 1 : y + 2, x - 1 : x + 2].mean()) for x, y in at[use][:12]]
    assert np.corrcoef(own, greys)[0, 1] > 0.6


def test_a_written_sequence_has_settings_with_the_lens(tmp_path: Path) -> None:
    settings = tmp_path / "camera.yaml"
    orb.Settings(sensor="mono", camera=FISHEYE).save(settings)
    folder = tmp_path / "room"
    words = f"synthesize {folder} --world room --sensor mono --frames 2 --lens {settings}"
    result = CliRunner().invoke(app, words.split())
    assert result.exit_code == 0, result.output
    read = orb.Settings.load(folder / "settings.yaml", "mono").camera
    assert (read.model, read.lens, read.fx) == ("kannala_brandt", FISHEYE.lens, FISHEYE.fx)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"sensor": "stereo"}, ("of one camera", "lens_pair", "mono or rgbd")),
        ({"sensor": "mono", "blur": 0.5}, ("blur", "leave")),
        ({"sensor": "mono", "size": (320, 240)}, ("size and lens", "exclude")),
        ({"sensor": "mono", "lens": CameraSettings(200, 200, 160, 120)}, ("image size", "width")),
        ({"sensor": "mono", "lens": "tum1"}, ("lens", "CameraSettings")),
    ],
)
def test_wrong_options(options: dict[str, object], words: tuple[str, ...]) -> None:
    with pytest.raises(SettingsError) as error:
        SyntheticOptions(**{"lens": FISHEYE, **options})  # type: ignore[arg-type]
    assert all(word in str(error.value) for word in words), error.value


def test_layouts_without_a_place_for_the_lens(tmp_path: Path) -> None:
    with pytest.raises(SettingsError, match="take the layout tum"):
        SyntheticSequence(SyntheticOptions(sensor="mono", frames=2, lens=FISHEYE)).write(
            tmp_path / "new", "euroc"
        )
