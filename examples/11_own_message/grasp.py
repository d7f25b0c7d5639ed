"""Closes and opens the gripper, with the message and service types of gripper_msgs.

Usage: python grasp.py      (connects to MJPLUG_CONNECT, by default to tcp/127.0.0.1:7447)
"""

from gripper_msgs import GripperState, MoveGripper

from mjplug.client import RequestRefused, connect

NAMES = {GripperState.OPEN: "open", GripperState.CLOSED: "closed", GripperState.BETWEEN: "between"}

with connect() as client:
    for opening in (0.03, 0.0, 0.09):
        response = client.call("/gripper/move", MoveGripper.Request(opening=opening))
        print(f"{NAMES[response.reached.state]}: {response.reached.opening * 1000:.1f} mm")
    state = client.subscribe("/gripper/state", GripperState).next(timeout=5.0)
    print(f"{state.TYPE} on /gripper/state: {NAMES[state.state]}")
    try:
        client.call("/gripper/move", opening=0.2)
    except RequestRefused as error:
        print(error)
    # Without the class, a message is a dictionary.
    print(sorted(client.subscribe("/gripper/state", dict).next(timeout=5.0)))
