"""All commands, which register themselves with the application."""

from jaxdamp.cli import law_commands, record_commands, ride_commands
from jaxdamp.cli.application import app


__all__ = ["app", "law_commands", "record_commands", "ride_commands"]
