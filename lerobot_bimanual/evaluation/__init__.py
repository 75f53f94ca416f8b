"""What was played in an evaluation, in a form that anybody can play again."""
