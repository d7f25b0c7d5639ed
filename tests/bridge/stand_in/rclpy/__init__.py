"""A strict replacement of rclpy for machines without ROS: only the calls of the bridge and of its tests.

It has rclpy's signatures (Humble to Rolling, as documented) and the traits that a bridge can stumble over: an executor
that sleeps until something wakes it, callback groups that exclude each other, handles that are gone once destroyed,
parameters with types. Anything else raises. Nodes meet in `bridge.graph`, in the process of the tests, whose address is
in `RCLPY_STAND_IN`.
"""

from rclpy import _interfaces
from rclpy._context import context
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions

_interfaces.install()


def init(*, args=None, context=None, domain_id=None, signal_handler_options=None):
    _only_default(context=context, domain_id=domain_id)
    _context().start(args, signal_handler_options or SignalHandlerOptions.ALL)


def shutdown(*, context=None, uninstall_handlers=None):
    _only_default(context=context, uninstall_handlers=uninstall_handlers)
    _context().shutdown()


def ok(*, context=None):
    _only_default(context=context)
    return _context().ok


def create_node(
    node_name,
    *,
    context=None,
    cli_args=None,
    namespace=None,
    use_global_arguments=True,
    enable_rosout=True,
    start_parameter_services=True,
    parameter_overrides=None,
    allow_undeclared_parameters=False,
    automatically_declare_parameters_from_overrides=False,
):
    _only_default(context=context, cli_args=cli_args, namespace=namespace, parameter_overrides=parameter_overrides)
    if (use_global_arguments, enable_rosout, start_parameter_services) != (True, True, True):
        raise NotImplementedError
    if allow_undeclared_parameters or automatically_declare_parameters_from_overrides:
        raise NotImplementedError
    return Node(node_name)


def _context():
    return context


def _only_default(**arguments):
    for name, value in arguments.items():
        if value is not None:
            raise NotImplementedError(f"the stand-in has no {name}")
