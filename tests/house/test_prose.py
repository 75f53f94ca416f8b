"""The words of the code and the documents are those of the field, as docs/glossary.md has them."""

import re
from pathlib import Path

ROOT = Path(__file__).parents[2]
FOLDERS = ("lerobot_bimanual", "envs", "policies", "robots", "benchmarks", "scripts", "examples", "docs")
INSTEAD = {
    r"\b(some|any|every|no)body\b|\bwhoever\b": "the subject by its name, or the passive",
    r"\bjust if\b": "if and only if",
    r"\bis none of\b": "is not one of",
    r"\blooks? again\b|\breread\w*": "replanning",
    r"\bthe world as it is\b|\blevel[ _]0\b": "nominal",
    r"\b(stands?|lies?) there\b": "is stored, exists",
    r"\bblam\w+": "failure attribution",
    r"\brungs?\b": "condition",
    r"\bwitness\w*": "episode monitor",
    r"\b(LEAST|MOST)_\w+": "MIN_, MAX_",
    r"\bladders?\b": "robustness sweep",
    r"\bblind (control|baseline)\b": "open-loop baseline",
    r"\bsolo\b|\blearners?\b|\bcampaigns?\b": "single_arm, run, evaluator",
    r"\bcertificates? (of|for)\b|\bcertif(y|ied)\b": "expert report",
    r"\bthe verb\b": "the command",
}
"""Pattern of words -> what to write."""
EXEMPT = ("benchmarks/results/", "CHANGELOG.md", "envs/lerobot_env_bimanual/perturbations/instruction.toml")
"""Dated reports, which keep the words of their time, and instructions to a policy, which are colloquial on purpose."""


def test_no_text_uses_words_that_the_glossary_replaces() -> None:
    paths = [*ROOT.glob("*.md"), *(path for folder in FOLDERS for path in (ROOT / folder).rglob("*"))]
    texts = [path for path in paths if path.suffix in (".py", ".md", ".sh", ".toml", ".jinja", ".html")]
    assert len(texts) > 200
    found = []
    for path in texts:
        name = str(path.relative_to(ROOT))
        if name.startswith(EXEMPT) or "__pycache__" in name:
            continue
        for number, line in enumerate(path.read_text(encoding="utf-8").splitlines(), 1):
            found += [
                f"{name}:{number}: {word[0]} -> {instead}"
                for pattern, instead in INSTEAD.items()
                for word in re.finditer(pattern, line)
            ]
    assert not found, "\n".join(found)
