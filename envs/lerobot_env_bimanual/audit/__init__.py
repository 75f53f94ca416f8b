"""Results played again without the policy, claim by claim."""
