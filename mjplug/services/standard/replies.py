"""Results of the standard services. A refused request gets a response of the service's type, with a code and a text."""

from collections.abc import Callable, Generator
from functools import wraps
from typing import Any

from mjplug.errors import RequestError
from mjplug.physics.scheduler import Slow
from mjplug_schemas.message import Message
from mjplug_schemas.simulation_interfaces import Result

UNSUPPORTED = Result.RESULT_FEATURE_UNSUPPORTED
OK = Result.RESULT_OK
NOT_FOUND = Result.RESULT_NOT_FOUND
INCORRECT_STATE = Result.RESULT_INCORRECT_STATE
FAILED = Result.RESULT_OPERATION_FAILED

Handler = Callable[..., Any]


class ResultError(RequestError):
    """A refused request.

    Attributes:
        code: The code of the result.

    Args:
        code: As above.
        text: The reason.
    """

    def __init__(self, code: int, text: str) -> None:
        super().__init__(text)
        self.code = code


def done(text: str = "") -> Result:
    """Returns the result of a request that succeeded, with additional information."""
    return Result(result=OK, error_message=text)


def failed(error: RequestError) -> Result:
    """Returns the result of a refused request; its code is 4 unless the error has one."""
    return Result(result=error.code if isinstance(error, ResultError) else FAILED, error_message=str(error))


def replying(handler: Handler, response: type[Message]) -> Handler:
    """Returns a service handler that answers a RequestError of `handler` with a response that contains the result.

    Args:
        handler: Returns the response, or is a generator that yields waits and returns the response.
        response: The class of the response; it has the field `result`.
    """

    @wraps(handler)
    def handle(request: Message, call: Any) -> Message | Slow:
        try:
            answer = handler(request, call)
        except RequestError as error:
            return response.model_validate({"result": failed(error)})
        return _slow(answer, response) if isinstance(answer, Generator) else answer

    return handle


def _slow(handler: Slow, response: type[Message]) -> Slow:
    try:
        return (yield from handler)
    except RequestError as error:
        return response.model_validate({"result": failed(error)})
