"""How ``--help`` groups commands."""

from collections.abc import Mapping, Sequence

import typer

Panels = Mapping[str, Sequence[str]]  # the commands of each panel, in the order of the help


def group(app: typer.Typer, panels: Panels) -> None:
    """Give each command of an app its panel; every command is in one."""
    panel_of = {name: panel for panel, names in panels.items() for name in names}
    for command in app.registered_commands:
        assert command.callback is not None
        command.name = command.name or command.callback.__name__
        command.rich_help_panel = panel_of[command.name]
    for each in app.registered_groups:
        each.rich_help_panel = panel_of[str(each.name)]
    order = list(panel_of)
    app.registered_commands.sort(key=lambda command: order.index(str(command.name)))
