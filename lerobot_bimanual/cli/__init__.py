"""`lerobot-bimanual GROUP COMMAND --flag=value`: the one command line of the project.

Core knows no command but its own. Every installed distribution adds commands through the entry-point group
`lerobot_bimanual.commands`, so core never imports a plugin by name.

How to write a command
    1. A function with one parameter, a dataclass, returning None or an exit code::

           @dataclass
           class DatasetGenerateConfig:
               task: str = "all"  # task names, comma separated, or a suite
               seeds: str = "0:100"  # half-open range a:b of the training split
               # A comment above the field is shown as well; use it for a text
               # that is longer than a line.
               output: Path = field(kw_only=True)  # new folder (no default: the flag is required)

           def dataset_generate(config: DatasetGenerateConfig) -> None:
               '''Record expert demonstrations as a LeRobot dataset.

               Further paragraphs, and a Google-style section of examples (whole command lines,
               one per line), are shown by `lerobot-bimanual help dataset generate`.
               '''

    2. An entry point of the distribution that owns it, whose name is a group and a command, or a command alone:
       `"dataset generate" = "package.commands.dataset_generate:dataset_generate"`. One that needs more than its
       distribution requires names an extra of it behind: `"... :dataset_generate [lerobot]"`.
    3. Light at import: simulation and learning modules are imported inside the function, because
       `--help` imports the command's module. The first docstring line is read from the source without
       importing anything, for the list of commands.
    4. Failures that a user can cause are raised as `lerobot_bimanual.errors.BimanualError`: the command
       prints the message on one line and exits with 1. Set LEROBOT_BIMANUAL_TRACEBACK=1 to see the traceback.
    5. It ends with `show_next(...)`, the command that continues the work, unless its output is for programs.
    6. A command that can be interrupted and continued says so: it raises `KeyboardInterrupt("how")` in place of the
       one that it catches, and the command prints the text behind "interrupted".

`lerobot_bimanual.cli.flags` says which flags a dataclass gets. Exit codes: 0 done (or what the command returned),
1 the command failed with a clear message, 2 the command line is wrong, 130 interrupted, 129 or 143 terminated,
141 unfinished because the reader of its output has left.
"""

from lerobot_bimanual.cli.command_line import config_type_of, find_command, find_commands, main

__all__ = ["config_type_of", "find_command", "find_commands", "main"]
