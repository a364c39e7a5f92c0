"""The message types that are read, by what the map file uses a topic as."""

IMAGE = "sensor_msgs/msg/Image"
COMPRESSED = "sensor_msgs/msg/CompressedImage"
CAMERA_INFO = "sensor_msgs/msg/CameraInfo"
DISPARITY = "stereo_msgs/msg/DisparityImage"
ODOMETRY = "nav_msgs/msg/Odometry"
TWIST = "geometry_msgs/msg/TwistStamped"
IMU = "sensor_msgs/msg/Imu"
TRANSFORMS = "tf2_msgs/msg/TFMessage"
POINTS = "sensor_msgs/msg/PointCloud2"

PICTURES = (IMAGE, COMPRESSED)
STAMPED = (*PICTURES, CAMERA_INFO, DISPARITY, ODOMETRY, TWIST, IMU, POINTS)
"""Their first field is a header."""
ALLOWED: dict[str, tuple[str, ...]] = {
    **dict.fromkeys(("image", "depth", "right", "labels"), PICTURES),
    "disparity": (DISPARITY,),
    "info": (CAMERA_INFO,),
    "right_info": (CAMERA_INFO,),
    "speed": (ODOMETRY, TWIST),
    "yaw_rate": (ODOMETRY, TWIST, IMU),
    "cloud": (POINTS,),
    "tf": (TRANSFORMS,),
}
