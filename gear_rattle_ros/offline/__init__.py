"""Questions about whole runs, bags and many trajectories, without ROS."""
