"""The model and its analysis: numpy and numba only, no ROS, no files, no pictures."""
