"""Thin rclpy shells around the core."""
