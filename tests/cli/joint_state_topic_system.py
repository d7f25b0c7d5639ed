"""What JointStateTopicSystem 1.1 of topic_based_hardware_interfaces does with its two topics, after its C++ source."""

import math

from mjplug_schemas.sensor_msgs import JointState


class JointStateTopicSystem:
    """A client that keeps its rules, on plain keys and in CDR, which is what its middleware would carry.

    - Commands begin as NaN, and are published as such: NaN is not below the threshold.
    - `write` publishes only if the positions commanded differ from those read by more than the threshold in sum.
    - A message names every joint, but has values only of the interfaces that a joint declares.
    - `read` takes values by index for each name it knows; lists that are too short would throw. It throws too if the
      message has velocities or efforts that no joint has as a state interface.
    """

    THRESHOLD = 1e-5

    def __init__(self, client, joints, state_interfaces, states="robot_joint_states", commands="robot_joint_commands"):
        self._client, self._topic = client, commands
        self._listener = client.listen(states)
        self._joints, self._state_interfaces = joints, state_interfaces
        self._latest = JointState()
        self.states = {interface: dict.fromkeys(joints, math.nan) for interface in ("position", "velocity", "effort")}
        self.commands = {interface: dict.fromkeys(joints, math.nan) for interface in ("position", "velocity", "effort")}
        self.sent = []

    def wait_for_state(self):
        """Takes the next message that has come."""
        sample = self._listener.sample()
        assert str(sample.encoding) == "application/cdr;sensor_msgs/msg/JointState"
        self._latest = JointState.from_cdr(sample.payload.to_bytes())
        return self._latest

    def read(self):
        for interface in ("position", "velocity", "effort"):
            values = getattr(self._latest, interface)
            assert len(values) in (0, len(self._latest.name))
            assert not values or interface in self._state_interfaces, "State interface not found"
            for index, name in enumerate(self._latest.name):
                if name in self._joints and values and math.isfinite(values[index]):
                    self.states[interface][name] = values[index]

    def activate(self):
        """As a controller does that starts to hold the robot."""
        self.commands["position"].update(self.states["position"])

    def write(self):
        """Returns whether anything was published."""
        states, commands = self.states["position"], self.commands["position"]
        if sum(abs(states[joint] - commands[joint]) for joint in self._joints) <= self.THRESHOLD:
            return False
        message = {"name": list(self._joints), "position": [], "velocity": [], "effort": []}
        for joint, interfaces in self._joints.items():
            for interface in interfaces:
                message[interface].append(self.commands[interface][joint])
        self.sent.append(JointState(**message))
        self._client.put(self._topic, self.sent[-1].to_cdr(), "application/cdr;sensor_msgs/msg/JointState")
        return True
