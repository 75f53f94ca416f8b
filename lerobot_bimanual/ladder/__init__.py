"""What a policy survives: the same seeds on every rung of a ladder, each one dial of one axis away from the world as it is."""
