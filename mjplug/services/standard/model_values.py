"""`~/set_model_values`: changes friction, masses, gains, colours and other values of the model."""

from dataclasses import replace

from mjplug.errors import RequestError
from mjplug.model.recipe import CompositionError
from mjplug.model.values import Value, check_exists, checked
from mjplug.plugin import Call, Host, Slow
from mjplug.services.standard.world_builder import Build, WorldBuilder
from mjplug_schemas.mjplug_msgs import SetModelValues

MAX_VALUES = 1000
"""Maximum number of values in a request."""


def offer(host: Host, builder: WorldBuilder) -> None:
    """Declares the service. All values of a request take effect together, or none does.

    Args:
        host: The host of the server.
        builder: Changes the model.
    """

    def set_values(request: SetModelValues.Request, call: Call) -> Slow:
        if len(request.values) > MAX_VALUES:
            raise RequestError(f"{len(request.values)} values are given; at most {MAX_VALUES} are accepted")
        wanted = []
        for index, item in enumerate(request.values):
            try:
                wanted.append(checked(item.element, item.attribute, item.values))
            except RequestError as error:
                raise RequestError(f"values[{index}]: {error}; nothing was changed") from None

        def plan(build: Build) -> None:
            build.recipe = replace(build.before, values=_merged(build.before.values, wanted))
            model = build.compose(build.recipe).model
            for index, value in enumerate(wanted):
                try:
                    check_exists(model, value)
                except RequestError as error:
                    raise RequestError(f"values[{index}]: {error}") from None

        if wanted:
            try:
                yield from builder.change(plan)
            except (CompositionError, RequestError) as error:
                raise RequestError(f"{error}; nothing was changed") from None
        return SetModelValues.Response(success=True, message=f"set {len(wanted)} values")

    host.create_service(SetModelValues, "~/set_model_values", set_values)


def _merged(before: tuple[Value, ...], wanted: list[Value]) -> tuple[Value, ...]:
    """Returns all values; a newer one replaces an older one at the same place."""
    by_place = {value.place: value for value in (*before, *wanted)}
    return tuple(by_place.values())
