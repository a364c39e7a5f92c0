"""ROS 2 bags: folders and single files, of both storages."""
