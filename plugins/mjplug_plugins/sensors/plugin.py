"""The sensors plugin: prepares the message of each sensor and publishes it at its rate."""

from collections import defaultdict

from mjplug.plugin import CdrFrame, Host, Plugin, PluginError, Publisher
from mjplug.plugin.bundled import ros_tokens
from mjplug_plugins.sensors.choice import chosen
from mjplug_plugins.sensors.exact import exact_values
from mjplug_plugins.sensors.frames import disagreement, frame_of, reference_in_frame
from mjplug_plugins.sensors.kinds import KINDS
from mjplug_plugins.sensors.model_sensors import Sensor
from mjplug_plugins.sensors.noise import Noise
from mjplug_plugins.sensors.parameters import SensorParameters, SensorsParameters
from mjplug_plugins.sensors.readings import STAMPED, TYPES, message_of, writers
from mjplug_schemas.message import Message


class Sensors(Plugin[SensorsParameters]):
    """Publishes IMUs, force-torque sensors, poses, magnetometers, rangefinders and other sensors of the model.

    The plugin finds them by the names and types of the sensors in the model, with the naming of mujoco_ros2_control
    (`<name>_gyro` and `<name>_accel` are an IMU), or in the configuration. The values of a message belong to the state
    at its stamp, which is the beginning of the last step.
    """

    stateless = True

    def init(self, host: Host, parameters: SensorsParameters) -> None:
        """Finds the sensors, prepares their messages and starts the timers."""
        sensors = chosen(host, parameters)
        if not sensors:
            host.logger.warning("no sensor was found in the model and no sensor is configured: nothing is published")
        seed = int(host.random.integers(2**63))
        rates: dict[float, list[_Reading]] = defaultdict(list)
        topics: dict[str, str] = {}
        tokens = ros_tokens((sensor.name for sensor, settings in sensors if not settings.topic), "sensor", host.logger)
        for sensor, settings in sensors:
            if message := disagreement(host.model, sensor):
                host.logger.warning("%s: the message is in the frame of the first", message)
            topic = settings.topic or f"{tokens[sensor.name]}/{KINDS[sensor.kind].topic}"
            reading = _Reading(host, sensor, topic, _complete(settings, parameters), parameters.world_frame, seed)
            if reading.topic in topics:
                raise PluginError(
                    f"sensors {topics[reading.topic]!r} and {sensor.name!r} have the same topic {reading.topic}; set "
                    "another `topic` for one of them"
                )
            topics[reading.topic] = sensor.name
            rates[settings.rate or parameters.rate].append(reading)
        for rate, readings in rates.items():
            _start(host, rate, readings)


class _Reading:
    """The message and the publisher of one sensor.

    Attributes:
        topic: Full name of its topic.
        publisher: Publisher of its messages.
    """

    def __init__(
        self, host: Host, sensor: Sensor, topic: str, settings: SensorParameters, world: str, seed: int
    ) -> None:
        self._host = host
        self.topic = host.full_name(topic)
        self.publisher: Publisher[Message] = host.create_publisher(TYPES[sensor.kind], topic, sample=self.sample)
        exact = exact_values(host.model, host.data, sensor)
        noisy = bool(settings.noise) and any(source.noise for source in sensor.parts.values())
        self._noise = Noise(sensor, exact, seed) if noisy else None
        cutoff = sensor.main.cutoff
        frame = frame_of(host.model, sensor, world) if settings.frame_id is None else settings.frame_id
        self._message = CdrFrame(message_of(sensor, settings, host.frame_id(frame), cutoff, noisy))
        values = self._noise.values if self._noise else exact
        places = {role: reference_in_frame(host.model, source) for role, source in sensor.parts.items()}
        references = {role: place for role, place in places.items() if place is not None}
        self._writers = writers(sensor, settings, values, self._message, cutoff, references)
        self._stamped = sensor.kind in STAMPED

    def publish(self) -> None:
        """Publishes the current sensor values."""
        self.publisher.publish_frame(self.sample())

    def sample(self) -> CdrFrame:
        """Returns the message with the current sensor values."""
        time_ns = self._host.sensor_time_ns
        if self._noise is not None:
            self._noise.draw(time_ns, self._host.lineage)
        for write in self._writers:
            write()
        if self._stamped:
            self._message.set_stamp("header.stamp", time_ns)
        return self._message


def _start(host: Host, rate: float, readings: list[_Reading]) -> None:
    """Starts a timer that publishes readings at a rate [Hz]."""

    def publish() -> None:
        for reading in readings:
            if reading.publisher.matched:
                reading.publish()

    host.create_timer(1.0 / rate, publish, while_matched=[reading.publisher for reading in readings])


def _complete(settings: SensorParameters, parameters: SensorsParameters) -> SensorParameters:
    """Returns a sensor's settings, completed with the defaults of the plugin."""
    return settings.model_copy(
        update={
            "noise": parameters.noise if settings.noise is None else settings.noise,
            "convention": settings.convention or parameters.fts_convention,
            "field_scale": parameters.field_scale if settings.field_scale is None else settings.field_scale,
        }
    )
