"""Knocks the tower down with the ball, then restores all poses and velocities.

Usage: python rebuild.py      (connects to MJPLUG_CONNECT, by default to tcp/127.0.0.1:7447)
"""

from mjplug.client import connect

with connect() as client:
    states = client.subscribe("/things/free_joint_states", depth=1000)

    def after(seconds):
        """Steps the simulation for `seconds`; returns the last states by name (50 messages per second)."""
        client.call("~/step_simulation", steps=round(seconds / 0.002))
        messages = [states.next(timeout=5.0) for _ in range(round(seconds * 50))]
        return {state.name: state for state in messages[-1].free_joints}

    def height(state):
        """Returns the height of a body [m]."""
        return state.pose.pose.position.z

    tower = after(0.5)
    print(f"the top block is at {height(tower['block_6']):.3f} m")

    throw = {"name": "ball", "pose": tower["ball"].pose, "twist": {"twist": {"linear": {"x": -6.0, "z": 2.0}}}}
    client.call("~/set_free_joint_state", free_joints=[throw])
    print(f"after the throw it is at {height(after(1.5)['block_6']):.3f} m")

    client.call("~/set_free_joint_state", free_joints=list(tower.values()))
    again = after(0.02)
    moved = max(abs(height(again[name]) - height(tower[name])) for name in tower)
    print(f"rebuilt: it is at {height(again['block_6']):.3f} m, and nothing is more than {moved * 1000:.2f} mm off")
