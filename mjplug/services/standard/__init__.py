"""The standard control interface of simulators, ROS package simulation_interfaces."""
