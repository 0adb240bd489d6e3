"""Lift and project: exact inverses, and right against twins and another library."""

import cv2
import naive_camera
import numpy as np
import pytest

from ffseg.camera.model import Camera
from ffseg.camera.projections import Affine, Fisheye, Polynomial, Projection, UnifiedSphere, polynomial_limit

COEFFICIENTS = np.array([-206.3866, 0.0, 2.165610e-03, -4.495456e-06, 1.810639e-08])
OCAM = Polynomial(
    COEFFICIENTS, (385.78, 241.02), (0.998881, -0.042038, 0.045079), polynomial_limit(COEFFICIENTS, 480.0)
)
MODELS: dict[str, tuple[Projection, int, int]] = {
    "unified": (UnifiedSphere(Affine(280, 280, 399.5, 299.5), 0.95, (0, 0, 0, 0)), 800, 600),
    "parabolic": (UnifiedSphere(Affine(280, 280, 399.5, 299.5), 1.0, (0, 0, 0, 0)), 800, 600),
    "distorted": (UnifiedSphere(Affine(282, 281, 516.6, 386.3, -0.59), 1.14, (0.077, 0.028, 1e-3, 2e-3)), 1024, 768),
    "folding": (UnifiedSphere(Affine(280, 280, 399.5, 299.5, 1.0), 1.5, (-0.1, 1e-3, 1e-3, -2e-3)), 800, 600),
    "pinhole": (UnifiedSphere(Affine(600, 610, 320, 240), 0.0, (-0.2, 0.05, 0, 0)), 640, 480),
    "fisheye": (Fisheye(Affine(230, 231, 399.5, 299.5, 0.3), (0.02, -0.01, 1e-3, 0)), 800, 600),
    "equidistant": (Fisheye(Affine(150, 150, 399.5, 299.5), (0, 0, 0, 0)), 800, 600),
    "ocam": (OCAM, 748, 480),
}


def whole_image(width: int, height: int) -> np.ndarray:
    x, y = np.meshgrid(np.arange(width, dtype=float), np.arange(height, dtype=float))
    return np.stack([x, y], axis=-1).reshape(-1, 2)


@pytest.mark.parametrize("name", MODELS)
def test_project_undoes_lift_over_the_whole_image(name: str) -> None:
    model, width, height = MODELS[name]
    pixels = whole_image(width, height)
    rays = model.lift(pixels)
    valid = ~np.isnan(rays).any(axis=1)
    back = model.project(rays[valid])
    assert valid.mean() > (0.3 if name == "folding" else 0.8)
    assert np.abs(back - pixels[valid]).max() < 1e-9  # the promise; rounding alone leaves about 1e-12
    assert np.abs(np.sum(rays[valid] ** 2, axis=1) - 1).max() < 1e-14


@pytest.mark.parametrize("name", MODELS)
def test_lift_undoes_project(name: str) -> None:
    rng = np.random.default_rng(3)
    model, _, _ = MODELS[name]
    points = rng.normal(size=(4000, 3)) * rng.uniform(0.1, 50, (4000, 1))
    pixels = model.project(points)
    seen = ~np.isnan(pixels).any(axis=1)
    assert seen.any()
    rays = model.lift(pixels[seen])
    expected = points[seen] / np.linalg.norm(points[seen], axis=1, keepdims=True)
    assert np.abs(rays - expected).max() < 1e-7  # a ray near the model's own border is a square root's error away


@pytest.mark.parametrize("name", ["unified", "distorted", "folding", "pinhole"])
def test_sphere_agrees_with_its_twin(name: str) -> None:
    rng = np.random.default_rng(4)
    model, _, _ = MODELS[name]
    assert isinstance(model, UnifiedSphere)
    points = rng.normal(size=(50, 3)) + np.array([0, 0, 2.5])
    k = model.affine
    for point, pixel in zip(points, model.project(points), strict=True):
        if not np.isnan(pixel).any():
            twin = naive_camera.unified_project(point, model.xi, (k.fx, k.fy, k.cx, k.cy), k.skew, model.distortion)
            assert pixel == pytest.approx(twin, abs=1e-9)


def test_fisheye_agrees_with_opencv() -> None:
    rng = np.random.default_rng(5)
    points = rng.normal(size=(60, 1, 3)) + np.array([0, 0, 3.0])
    points = points[points[:, 0, 2] > 0.2]
    k = np.array([[230, 0.0, 399.5], [0, 231, 299.5], [0, 0, 1]])
    d = np.array([0.02, -0.01, 1e-3, 5e-4])
    expected, _ = cv2.fisheye.projectPoints(points, np.zeros(3), np.zeros(3), k, d)
    model = Fisheye(Affine(230, 231, 399.5, 299.5), (0.02, -0.01, 1e-3, 5e-4))
    assert model.project(points[:, 0]) == pytest.approx(expected[:, 0], abs=1e-9)


def test_ocam_agrees_with_its_twin_in_the_contracts_axes() -> None:
    for column, row in ((10.0, 400.0), (385.0, 240.0), (700.0, 20.0)):
        down, right, away = naive_camera.ocam_lift(column, row, COEFFICIENTS, OCAM.center, OCAM.affine)
        assert OCAM.lift(np.array([[column, row]]))[0] == pytest.approx([right, down, -away], abs=1e-12)


def test_directions_that_are_not_shown_have_no_pixel() -> None:
    sphere = MODELS["unified"][0]
    assert np.isnan(sphere.project(np.array([[0.0, 0.0, -1.0], [0.0, 0.0, 0.0]]))).all()
    assert np.isnan(MODELS["equidistant"][0].project(np.array([[0.0, 0.0, -1.0]]))).all()
    assert np.isnan(OCAM.project(np.array([[0.0, 0.0, -1.0], [0.0, 0.0, 0.0]]))).all()
    assert not np.isnan(OCAM.project(np.array([[0.0, 0.0, 1.0]]))).any()


def test_camera_geometry_of_a_tilted_camera() -> None:
    up = np.array([0.1, -0.2, -1.0])
    camera = Camera(MODELS["unified"][0], 800, 600, (399.5, 299.5), 0.9, up / np.linalg.norm(up), 46, 292)
    assert camera.level() @ camera.up == pytest.approx([0, 0, -1], abs=1e-15)
    assert np.linalg.det(camera.level()) == pytest.approx(1)
    ground = camera.meet_plane(camera.lift(np.array([[300.0, 200.0], [500.0, 400.0]])), 0.25)
    assert camera.altitude(ground) == pytest.approx([0.25, 0.25])
    assert np.isnan(camera.meet_plane(camera.up)).all()
    assert camera.altitude(np.zeros(3)) == pytest.approx(0.9)


def test_domain_is_the_disc_inside_the_rim() -> None:
    camera = Camera(MODELS["unified"][0], 800, 600, (399.5, 299.5), rim_radius=292.0)
    domain = camera.domain()
    assert domain[299, 399]
    assert domain[299, 691]
    assert not (domain[299, 692])
    assert not (domain[0, 0])
    whole = Camera(MODELS["unified"][0], 800, 600, (399.5, 299.5), mount_height=0.9)
    assert np.array_equal(whole.domain(), np.isfinite(whole.ground()).all(axis=-1))
    assert whole.domain()[299, 692], "without a rim the horizon is the end: 294.7 px from the centre"
    assert not whole.domain()[299, 695]
