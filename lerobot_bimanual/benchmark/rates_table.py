"""Success rates as a table for the terminal."""

from collections.abc import Mapping

from rich.table import Table

from lerobot_bimanual.statistics import SuccessRate


def rates_table(title: str, rates: Mapping[str, SuccessRate]) -> Table:
    """One row per entry of `rates`, who acted -> success, with the 95 % Wilson interval."""
    table = Table(title=title)
    table.add_column("who acts")
    table.add_column("solved", justify="right")
    table.add_column("95 % interval (Wilson)", justify="right")
    for who, rate in rates.items():
        low, high = rate.interval
        table.add_row(who, f"{rate.successes} of {rate.trials}", f"{low:.0%} to {high:.0%}")
    return table
