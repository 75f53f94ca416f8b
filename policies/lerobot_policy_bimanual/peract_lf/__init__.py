"""PerAct-LF: a leading and a following PerAct."""
