"""`lerobot-bimanual GROUP COMMAND --flag=value`: the one command line of the project.

Core knows no command but its own. Every installed distribution adds commands through the entry-point group
`lerobot_bimanual.commands`, so core never imports a plugin by name.

CONTRIBUTING.md, "Adding a command", says how to write one, `lerobot_bimanual.cli.flags` which flags a dataclass gets.
Exit codes: 0 done (or what the command returned), 1 the command failed with a clear message, 2 the command line is wrong,
3 a check is inconclusive, 130 interrupted, 129 or 143 terminated, 141 unfinished because the reader of its output has left.
"""

from lerobot_bimanual.cli.command_line import config_type_of, find_command, find_commands, main

__all__ = ["config_type_of", "find_command", "find_commands", "main"]
