"""What pictures of a log go with its grids: at which times there are grids, and which camera shows what they show."""

from semgrid_eval.grids.spec import GridConfig
from semgrid_eval.log.reader import LogReader
from semgrid_eval.motion import EgoMotion, Pose
from semgrid_eval.sensors.kinds import times_of
from semgrid_eval.sensors.lidar import LidarSensor

_FIRST_CHOICE = "front"


def frame_poses(log: LogReader, grid: GridConfig) -> list[Pose]:
    """Return the vehicle's pose in the odom frame at each time of the sensor that leads the target.

    Raises:
        LogError: there is no such sensor, or what is read is damaged.
    """
    motion = EgoMotion(log.motion(), grid.integrator)
    return [motion.pose_at(stamp_ns) for stamp_ns in times_of(log, grid.leader)]


def shown_camera(log: LogReader, grid: GridConfig) -> str | None:
    """Return the camera that leads the target; else one of the grid, else one of the log; None where it has none.

    Raises:
        LogError: a camera leads the target, and the log does not have it.
    """
    if grid.camera is not None:
        return log.choose_camera(grid.camera.camera)
    cameras = log.scene.cameras
    choices = (grid.camera_beside, _FIRST_CHOICE, *cameras)
    return next((name for name in choices if name in cameras), None)


def shown_lidar(log: LogReader, grid: GridConfig) -> str | None:
    """Return the LiDAR that leads the target, to be shown where there is no camera; else None.

    Raises:
        LogError: the log does not have it.
    """
    if shown_camera(log, grid) is None and isinstance(grid.leader, LidarSensor):
        return log.choose_lidar(grid.leader.lidar)
    return None
