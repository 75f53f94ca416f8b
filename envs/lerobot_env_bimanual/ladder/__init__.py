"""The ladder: a policy, the expert and the blind control on the same seeds at every rung."""
