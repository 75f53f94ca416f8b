"""The environment as a benchmark of vla-eval, the evaluation harness for vision-language-action models."""
