"""The command `policy recipes`."""

from dataclasses import dataclass

import pandas as pd

from lerobot_bimanual.benchmark.recipes import GROUP, Recipe
from lerobot_bimanual.distributions import entries
from lerobot_bimanual.errors import BimanualError
from lerobot_bimanual.terminal import print_table, show_next


@dataclass
class RecipesConfig:
    """The command has no flags."""


def policy_recipes(config: RecipesConfig) -> None:
    """List the installed recipes: the view that a policy learns from, the steps, the batch size and the file.

    Give a file to `lerobot-train` as `--config_path`, or a changed copy to `policy benchmark --recipe=FILE.yaml`.

    Examples:
        lerobot-bimanual policy recipes
    """
    rows = []
    for policy in entries(GROUP):
        for name, path in Recipe.files(policy).items():
            recipe = Recipe.find(policy, name)
            numbers = {"view": recipe.view, "steps": recipe.steps, "batch": recipe.batch_size}
            rows.append({"policy": policy, "recipe": name, **numbers, "file": path})
    if not rows:
        raise BimanualError("no recipes are installed: pip install lerobot_policy_bimanual")
    print_table(pd.DataFrame(rows))
    show_next("lerobot-bimanual", "policy", "benchmark", "--policy=peract2", "--dry_run")
