"""Calibrated omnidirectional cameras: rays, files and motion. Knows no image."""

from ffseg.camera.calibration import load_camera, load_mounted_camera
from ffseg.camera.model import Camera
from ffseg.camera.motion import Motion, Pose, planar_pose
from ffseg.camera.poses import load_pairs, load_poses

__all__ = ["Camera", "Motion", "Pose", "load_camera", "load_mounted_camera", "load_pairs", "load_poses", "planar_pose"]
