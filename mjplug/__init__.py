"""mjplug: a MuJoCo simulation server that speaks Zenoh, with ROS 2's names and messages."""
