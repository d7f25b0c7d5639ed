"""The command `ros2 run mjplug_bridge_ros2 bridge`."""

import signal
import sys
from collections.abc import Sequence
from contextlib import suppress
from typing import Any

import rclpy
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor

from mjplug_bridge_ros2.errors import SettingsError
from mjplug_bridge_ros2.handover import Handover

_NO_ZENOH = (
    f"eclipse-zenoh is not installed for {sys.executable}: create an environment that includes ROS's packages with "
    "`python3 -m venv --system-site-packages ~/mjplug_ros`, install eclipse-zenoh there with "
    "`~/mjplug_ros/bin/pip install eclipse-zenoh`, and start the bridge after `source ~/mjplug_ros/bin/activate`"
)


def main(args: Sequence[str] | None = None) -> int:
    """Runs the bridge until it is interrupted.

    Args:
        args: The ROS command line arguments; None: those of this process.

    Returns:
        The exit code: 2 for invalid parameters, 1 if eclipse-zenoh is not installed.
    """
    try:
        import zenoh  # noqa: F401, PLC0415
    except ModuleNotFoundError:
        print(_NO_ZENOH, file=sys.stderr)
        return 1
    rclpy.init(args=args)
    node = rclpy.create_node("mjplug_bridge")
    executor = SingleThreadedExecutor()
    executor.add_node(node)
    try:
        return _run(node, executor)
    except KeyboardInterrupt:
        return 0
    finally:
        signal.signal(signal.SIGINT, signal.SIG_IGN)
        executor.shutdown()
        node.destroy_node()
        if rclpy.ok():
            rclpy.shutdown()


def _run(node: Any, executor: Any) -> int:
    # These modules can be imported only after `main` has checked that zenoh is installed.
    from zenoh import Session, ZError  # noqa: PLC0415

    from mjplug_bridge_ros2.bridge import Bridge  # noqa: PLC0415
    from mjplug_bridge_ros2.session import Connector, configure, plain  # noqa: PLC0415
    from mjplug_bridge_ros2.settings import read_settings  # noqa: PLC0415

    logger = node.get_logger()
    try:
        settings = read_settings(node)
        config = configure(settings)
    except SettingsError as error:
        logger.fatal(f"invalid parameters:\n{error}")
        return 2
    except ZError as error:
        logger.fatal(f"the Zenoh configuration is invalid: {plain(error)}")
        return 2
    handover = Handover(executor)
    bridges: list[Bridge] = []
    reasons: set[str] = set()

    def start(session: Session) -> None:
        bridges.append(Bridge(node, handover, session, settings))

    def report(reason: str) -> None:
        if reason not in reasons:
            logger.info(f"not connected yet: {reason}")
            reasons.add(reason)

    logger.info(f"waiting for a server at {' or '.join(settings.connect) or settings.zenoh_config}")
    connector = Connector(
        config, lambda session: handover.call(start, session), lambda reason: handover.call(report, reason)
    )
    try:
        with suppress(KeyboardInterrupt, ExternalShutdownException):
            connector.start()
            executor.spin()
    except Exception:
        # If a signal shuts the context down during `spin`, rclpy raises various errors, such as RCLError.
        if rclpy.ok():
            raise
    finally:
        # `ros2 launch` may send two signals; the second would abort the cleanup, and Zenoh's threads would not end.
        signal.signal(signal.SIGINT, signal.SIG_IGN)
        for bridge in bridges:
            bridge.close()
        connector.close()
    return 0
