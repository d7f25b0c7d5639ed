"""The arguments that the commands about topics share."""

from typing import Annotated

import typer

from mjplug.cli.names import complete_message_type, complete_topic

TopicName = Annotated[str, typer.Argument(metavar="TOPIC", help="Name of the topic.", autocompletion=complete_topic)]

MessageType = Annotated[
    str | None,
    typer.Argument(
        metavar="TYPE",
        help="Type of the topic. Default: as the server reports it.",
        autocompletion=complete_message_type,
    ),
]
