"""Camera, poses and pairs files: what is read, and that everything else is refused by file and key."""

import re
from pathlib import Path

import numpy as np
import pytest

from ffseg.camera.calibration import load_camera, load_mounted_camera
from ffseg.camera.model import Camera
from ffseg.camera.poses import load_pairs, load_poses
from ffseg.camera.projections import Fisheye, Polynomial, UnifiedSphere
from ffseg.errors import CalibrationError

GOOD = """
model: unified
width: 800
height: 600
xi: 0.95
fx: 280.0
fy: 280.0
cx: 399.5
cy: 299.5
distortion: [0, 0, 0, 0]
mount_height: 0.9
up: [0, 0, -2]
robot_radius: 46
rim_radius: 292
"""
OCAM = """#polynomial coefficients for the DIRECT mapping function

5 -2.063866e+02 0.000000e+00 2.165610e-03 -4.495456e-06 1.810639e-08
#inverse
3 293.05 151.54 -11.13

#center
241.019976 385.783141
0.998881 -0.042038 0.045079
#size
480 748
"""
MATRIX_YAML = """%YAML:1.0
---
image_width: 1024
image_height: 768
camera_matrix: !!opencv-matrix
   rows: 3
   cols: 3
   dt: d
   data: [ 2.8e+02, -5.9e-01, 516., 0., 281., 386., 0., 0., 1. ]
distortion_coefficients: !!opencv-matrix
   rows: 1
   cols: 4
   dt: d
   data: [ 0.07, 0.02, 1.2e-03, 1.9e-03 ]
xi: 1.1422
"""
MATRIX_XML = """<?xml version="1.0"?>
<opencv_storage>
<image_width>640</image_width>
<image_height>480</image_height>
<fisheye_model>1</fisheye_model>
<K type_id="opencv-matrix"><rows>3</rows><cols>3</cols><dt>d</dt><data>230. 0. 320. 0. 231. 240. 0. 0. 1.</data></K>
<D type_id="opencv-matrix"><rows>4</rows><cols>1</cols><dt>d</dt><data>1e-2 0. 0. 0.</data></D>
</opencv_storage>
"""


def write(folder: Path, text: str, name: str = "camera.yaml") -> Path:
    path = folder / name
    path.write_text(text, encoding="utf-8")
    return path


def test_contract_file(tmp_path: Path) -> None:
    camera = load_camera(write(tmp_path, GOOD))
    assert isinstance(camera.projection, UnifiedSphere)
    assert (camera.width, camera.height, camera.center) == (800, 600, (399.5, 299.5))
    assert camera.up.tolist() == [0, 0, -1]
    assert (camera.mount_height, camera.robot_radius, camera.rim_radius) == (0.9, 46, 292)


def test_omnidir_inline_with_skew(tmp_path: Path) -> None:
    text = "model: omnidir\nwidth: 1024\nheight: 768\nxi: 1.1\nD: [0.1, 0, 0, 0]\n"
    text += "K: [[282, -0.6, 516], [0, 281, 386], [0, 0, 1]]\n"
    lens = load_camera(write(tmp_path, text)).projection
    assert isinstance(lens, UnifiedSphere)
    assert (lens.affine.skew, lens.distortion, lens.xi) == (-0.6, (0.1, 0, 0, 0), 1.1)


def test_lens_files_beside_a_camera_file(tmp_path: Path) -> None:
    write(tmp_path, OCAM, "calib_results.txt")
    camera = load_camera(write(tmp_path, "model: ocam\nfile: calib_results.txt\nmount_height: 1.2\n"))
    assert isinstance(camera.projection, Polynomial)
    assert (camera.width, camera.height, camera.mount_height) == (748, 480, 1.2)
    assert camera.center == (385.783141, 241.019976)
    write(tmp_path, MATRIX_XML, "lens.xml")
    assert isinstance(load_camera(write(tmp_path, "model: fisheye\nfile: lens.xml\n")).projection, Fisheye)


def test_lens_files_read_directly_know_no_mounting(tmp_path: Path) -> None:
    for text, kind in ((MATRIX_YAML, UnifiedSphere), (MATRIX_XML, Fisheye), (OCAM, Polynomial)):
        camera = load_camera(write(tmp_path, text))
        assert isinstance(camera.projection, kind)
        with pytest.raises(CalibrationError, match="mount_height"):
            camera.mounting()
    lens = load_camera(write(tmp_path, MATRIX_YAML)).projection
    assert isinstance(lens, UnifiedSphere)
    assert (lens.affine.skew, lens.xi, lens.distortion[3]) == (-0.59, 1.1422, 1.9e-3)


BAD = {
    "empty": ("", "must be a mapping"),
    "no model": (GOOD.replace("model: unified\n", ""), "model: missing"),
    "xi of a fisheye": (GOOD.replace("unified", "fisheye"), "xi: model fisheye has none; leave it out, or name"),
    "missing xi": (GOOD.replace("xi: 0.95\n", ""), "xi: missing"),
    "negative focal": (GOOD.replace("fx: 280.0", "fx: -1"), "fx: -1 is not"),
    "huge width": (GOOD.replace("width: 800", "width: 99999999"), "width: 99999999 is not"),
    "short distortion": (GOOD.replace("[0, 0, 0, 0]", "[0, 0]"), "distortion"),
    "zero up": (GOOD.replace("[0, 0, -2]", "[0, 0, 0]"), "up: the vector has no direction"),
    "rim inside robot": (GOOD.replace("rim_radius: 292", "rim_radius: 40"), "rim_radius: must exceed"),
    "zero mount": (GOOD.replace("mount_height: 0.9", "mount_height: 0"), "mount_height: 0 is not"),
    "mount in millimetres": (
        GOOD.replace("mount_height: 0.9", "mount_height: 900"),
        "mount_height: 900 is not a number above 0 and up to 150",
    ),
    "K and fx": (GOOD + "K: [[1, 0, 0], [0, 1, 0], [0, 0, 1]]\n", "fx: given beside K"),
    "not a camera matrix": (
        "model: omnidir\nwidth: 9\nheight: 9\nxi: 1\nK: [[1, 0, 0], [5, 1, 0], [0, 0, 1]]\n",
        "K: is not a camera matrix",
    ),
    "ocam without file": ("model: ocam\n", "file: missing"),
    "file not there": ("model: ocam\nfile: nowhere.txt\n", "nowhere.txt: cannot be read"),
    "alias": ("a: &x 1\nb: *x\n", "anchor"),
    "opencv: no matrix": (MATRIX_YAML.replace("camera_matrix", "other"), "camera_matrix: missing"),
    "opencv: short data": (MATRIX_YAML.replace(", 0., 0., 1. ]", "]"), "3x3 announced, 6 numbers given"),
    "opencv: nan": (MATRIX_YAML.replace("2.8e+02", ".Nan"), "camera_matrix: must be finite"),
    "opencv: zero rows": (MATRIX_YAML.replace("rows: 1", "rows: 0"), "distortion_coefficients: 0x4 announced"),
    "opencv: pinhole": (MATRIX_YAML.replace("xi: 1.1422\n", ""), "neither xi"),
    "opencv: bad xi": (MATRIX_YAML.replace("1.1422", "-3"), "xi: must be"),
    "opencv: no size": (MATRIX_YAML.replace("image_width: 1024\n", ""), "image_width: missing"),
    "xml: entity": ('<?xml version="1.0"?><!DOCTYPE a [<!ENTITY b "c">]><a>&b;</a>', "document type"),
    "xml: cut": (MATRIX_XML[:200], "not valid XML"),
    "xml: deep": ("<?xml version='1.0'?>" + "<a>" * 3000, "nested deeper"),
    "xml: twice": (MATRIX_XML.replace("</opencv_storage>", "<K>1</K></opencv_storage>"), "K: the key is given twice"),
    "ocam: positive a0": (OCAM.replace("5 -2.06", "5 2.06"), "must be negative"),
    "ocam: wrong count": (OCAM.replace("5 -2.06", "9 -2.06"), "ss .forward polynomial.: the line must be a count"),
    "ocam: words": (OCAM.replace("241.019976", "abc"), ":8: not a line of numbers"),
    "ocam: inf": (OCAM.replace("241.019976", "inf"), ":8: a number is not finite"),
    "ocam: cut": (OCAM.partition("#center")[0], "an OCamCalib file has 5"),
    "ocam: singular": (OCAM.replace("0.998881", "0").replace("-0.042038", "0"), "would collapse"),
    "ocam: size": (OCAM.replace("480 748", "480 0"), "height and width"),
}


@pytest.mark.parametrize("name", BAD)
def test_hostile_camera_files_are_refused_by_file_and_key(name: str, tmp_path: Path) -> None:
    text, said = BAD[name]
    path = write(tmp_path, text)
    with pytest.raises(CalibrationError, match=said) as caught:
        load_camera(path)
    assert str(tmp_path) in str(caught.value)


def test_missing_folder_and_binary_file(tmp_path: Path) -> None:
    for path in (tmp_path / "none.yaml", tmp_path):
        with pytest.raises(CalibrationError, match=r"cannot be read|not a regular file"):
            load_camera(path)
    path = tmp_path / "x.yaml"
    path.write_bytes(b"\xff\xfe\x00")
    with pytest.raises(CalibrationError, match="UTF-8"):
        load_camera(path)


@pytest.fixture
def camera(tmp_path: Path) -> Camera:
    return load_camera(write(tmp_path, GOOD))


def test_csv_poses_are_found_by_name(tmp_path: Path, camera: Camera) -> None:
    path = write(tmp_path, "image,x,y,theta\nb.png,1,2,0.5\na.png,0,0,0\nother.png,9,9,9\n", "poses.csv")
    poses = load_poses(path, ["a.png", "b.png", "c.png"], camera)
    assert (list(poses), poses["b.png"].position.tolist()) == (["a.png", "b.png"], [1, 2, 0])
    assert (poses["b.png"].rotation @ [1.0, 0.0, 0.0]) == pytest.approx([np.cos(0.5), np.sin(0.5), 0])


def test_tum_trajectory_in_image_order(tmp_path: Path, camera: Camera) -> None:
    half = np.sqrt(0.5)
    path = write(tmp_path, f"# t\n1.0 1 2 3 0 0 0 1\n2.0 1 2 3 0 0 {half} {half}\n", "traj.txt")
    poses = load_poses(path, ["a", "b"], camera)
    assert poses["a"].rotation == pytest.approx(np.eye(3))
    assert poses["b"].rotation @ [1.0, 0.0, 0.0] == pytest.approx([0, 1, 0])
    with pytest.raises(CalibrationError, match="give a list of names"):
        load_poses(path, "ab", camera)


BAD_POSES = {
    "header": ("img,x,y,theta\na,0,0,0\n", "header must be image,x,y,theta"),
    "semicolons": ("image;x;y;theta\r\na;0;0;0\n", ":1: the header .* apart by commas, it is 'image;x;y;theta'"),
    "columns": ("image,x,y,theta\na,0,0\n", ":2: 3 columns"),
    "word": ("image,x,y,theta\na,0,zero,0\n", ":2: y: 'zero' is not"),
    "nan": ("image,x,y,theta\na,nan,0,0\n", ":2: x: 'nan' is not"),
    "huge": ("image,x,y,theta\na,1e30,0,0\n", ":2: x: '1e30' is not"),
    "twice": ("image,x,y,theta\na,0,0,0\na,0,0,0\n", ":3: 'a' has a pose already"),
    "nobody": ("image,x,y,theta\nq,0,0,0\n", "no row names any of the 2 images"),
    "quote": ('image,x,y,theta\n"a,0,0,0\n', "not valid CSV"),
    "tum order": ("2 0 0 0 0 0 0 1\n1 0 0 0 0 0 0 1\n", ":2: timestamp: not later"),
    "tum count": ("1 0 0 0 0 0 0 1\n", "1 poses for 2 images"),
    "tum quaternion": ("1 0 0 0 0 0 0 1\n2 0 0 0 0 0 0 2\n", ":2: qx qy qz qw: not a unit"),
    "tum columns": ("1 0 0 0 0 0 1\n2 0 0 0 0 0 0 1\n", ":1: 7 values"),
}


@pytest.mark.parametrize("name", BAD_POSES)
def test_bad_poses_are_refused_by_line(name: str, tmp_path: Path, camera: Camera) -> None:
    text, said = BAD_POSES[name]
    with pytest.raises(CalibrationError, match=said):
        load_poses(write(tmp_path, text, "poses"), ["a", "b"], camera)


def test_pairs(tmp_path: Path) -> None:
    images = ["a", "b", "c"]
    assert dict(load_pairs(write(tmp_path, "previous,current\na,c\n"), images)) == {"c": "a"}
    for text, said in (
        ("previous,current\na,q\n", "'q' is not among"),
        ("previous,current\na,a\n", "paired with itself"),
        ("previous,current\na,b\nc,b\n", "has a previous image already"),
        ("current,previous\na,b\n", "header must be previous,current"),
    ):
        with pytest.raises(CalibrationError, match=said):
            load_pairs(write(tmp_path, text), images)


def test_a_mistyped_model_is_one_problem_with_the_nearest_name(tmp_path: Path) -> None:
    path = write(tmp_path, GOOD.replace("unified", "unifed"))
    with pytest.raises(CalibrationError) as caught:
        load_camera(path)
    (line,) = str(caught.value).splitlines()
    assert line.endswith("did you mean 'unified'?")


def test_a_key_near_to_none_is_told_the_keys_of_a_camera_file(tmp_path: Path) -> None:
    with pytest.raises(CalibrationError, match="zzz: unknown key; the keys are model, file, width,") as caught:
        load_camera(write(tmp_path, GOOD + "zzz: 1\n"))
    assert "config" not in str(caught.value)


LENSES = {
    "calib_results.txt": (OCAM, "ocam"),
    "lens.xml": (MATRIX_XML, "fisheye"),
    "lens.yml": (MATRIX_YAML, "omnidir"),
}


@pytest.mark.parametrize("name", LENSES)
def test_the_lines_a_lens_file_is_told_to_be_named_by_make_a_camera(name: str, tmp_path: Path) -> None:
    text, model = LENSES[name]
    with pytest.raises(CalibrationError) as caught:
        load_mounted_camera(write(tmp_path, text, name))
    lines = re.findall(r"'([^']+)'", str(caught.value))
    assert lines == [f"model: {model}", f"file: {name}", "mount_height: METRES"]
    assert load_mounted_camera(write(tmp_path, "\n".join(lines).replace("METRES", "1.5"))).mounting() == 1.5


def test_a_camera_file_without_a_height_is_told_the_key(tmp_path: Path) -> None:
    with pytest.raises(CalibrationError, match="add 'mount_height: METRES'"):
        load_mounted_camera(write(tmp_path, GOOD.replace("mount_height: 0.9\n", "")))
