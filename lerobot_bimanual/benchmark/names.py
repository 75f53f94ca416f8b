"""What the folders, lines and files of a benchmark are called."""


def place_name(task: str, variation: str) -> str:
    """What the folder and the line of a task, or of one of its variations, are called."""
    return task if variation == "any" else f"{task}_{variation}"


def run_name(policy: str, recipe: str, seed: int) -> str:
    """What the folder of a training is called."""
    return f"{policy}_{recipe}_seed{seed}"


def result_name(task: str, variation: str, policy: str, recipe: str, seed: int) -> str:
    """What the file of a row is called."""
    return f"{place_name(task, variation)}_{run_name(policy, recipe, seed)}.json"
